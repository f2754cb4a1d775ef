"""Commands for records of gait laboratories."""

from __future__ import annotations

from pathlib import Path

from hoof_env.commands.said import say, size
from hoof_env.errors import HoofEnvError


def compare(
    a: Path,
    b: Path,
    /,
    out: Path = Path("compare.png"),
    map_a: tuple[str, ...] = (),
    map_b: tuple[str, ...] = (),
    units_a: str = "auto",
    units_b: str = "auto",
    reverse_a: str = "auto",
    reverse_b: str = "auto",
    rate_a: float | None = None,
    rate_b: float | None = None,
    mass_a: float | None = None,
    mass_b: float | None = None,
    up_a: str = "auto",
    up_b: str = "auto",
    forward_a: str = "auto",
    forward_b: str = "auto",
    align: str = "stances",
    threshold: float | None = None,
    units: str = "auto",
    overwrite: bool = False,
) -> None:
    """Compare the ground reaction forces of two records, simulated or measured, limb by limb (needs 'lab').

    Args:
        a: the record that is taken as right: .csv, .txt, .tsv, .parquet (needs 'export'), .mot, .sto or .c3d.
        b: the record of which the errors are reported.
        out: the picture; ends in .png, .pdf or .svg.
        map_a: columns of A if they have other names than ours: time=Seconds force_x=-Fx force_y=Fz, or
            left_fore_force_y=LF_Fz ...; a - turns a column round, a + adds two, as left_force_y=p1_z+p3_z;
            Fz#2 is the second column Fz, #3 the third of all. left_fore=plate_1 renames a limb,
            left_fore=plate_1+plate_3 is the sum of two.
        map_b: columns of B.
        units_a: unit of A's forces: N, kN, N/kg, BW or %BW; auto takes the unit that the file states.
        units_b: unit of B's forces.
        reverse_a: components of A that point the other way: none, x, y or xy; auto turns both components of
            each limb with a vertical force that points into the ground.
        reverse_b: components of B that point the other way.
        rate_a: samples a second of A, if it has no times, or times that cannot be read.
        rate_b: samples a second of B.
        mass_a: mass of A's animal [kg], for body weights, if the file does not state the weight.
        mass_b: mass of B's animal [kg].
        up_a: axis of A's file that points upward: x, y, z, -x, -y or -z; auto is y, and in a .c3d the normal
            of its plates.
        up_b: axis of B's file that points upward.
        forward_a: axis of A's file in which the animal travels, likewise; auto is x.
        forward_b: axis of B's file in which the animal travels.
        align: stances lays each pair touchdown on touchdown, shift shifts B as a whole, none takes the times
            of the files.
        threshold: vertical force that makes a stance [N]; 20, or 1 % of the weight if forces are in body
            weights and the weight is unknown.
        units: unit of the errors: N or BW; auto is N if both records can be in N.
        overwrite: replace an existing picture.
    """
    from hoof_env._output import check_new
    from hoof_env.lab.columns import parse_mapping
    from hoof_env.lab.compare import compare
    from hoof_env.lab.picture import check_picture, draw, report
    from hoof_env.lab.read import read_record

    made = check_new(out, overwrite)
    check_picture(out)
    of_a = parse_mapping("--map-a", map_a)
    of_b = parse_mapping("--map-b", map_b)
    first = read_record(a, of_a, units_a, reverse_a, rate_a, mass_a, up_a, forward_a)
    second = read_record(b, of_b, units_b, reverse_b, rate_b, mass_b, up_b, forward_b)
    comparison = compare(first, second, align, threshold, units)
    draw(comparison, out)
    say(f"{report(comparison)}\n\n{out}: {size(out)}{made}")


def average(
    records: tuple[Path, ...],
    /,
    out: Path,
    map: tuple[str, ...] = (),
    units_in: str = "auto",
    reverse: str = "auto",
    rate: float | None = None,
    mass: float | None = None,
    up: str = "auto",
    forward: str = "auto",
    threshold: float | None = None,
    units: str = "auto",
    points: int = 101,
    overwrite: bool = False,
) -> None:
    """Write the mean stance of several trials, and its standard deviation, as a table.

    Args:
        records: one file or more that `hoof-env compare` reads; the options below hold for all of them.
        out: the table; ends in .csv.
        map: columns, as --map-a of `hoof-env compare`.
        units_in: unit of the files' forces: N, kN, N/kg, BW or %BW; auto takes the unit that each file
            states.
        reverse: components that point the other way: none, x, y or xy; auto turns both components of each
            limb with a vertical force that points into the ground.
        rate: samples a second, if the files have no times.
        mass: mass of the animal [kg], for body weights, if the files do not state the weight.
        up: axis of the files that points upward, as --up-a of `hoof-env compare`.
        forward: axis of the files in which the animal travels.
        threshold: vertical force that makes a stance [N]; 20, or 1 % of the weight if forces are in body
            weights and the weight is unknown.
        units: unit of the table: N or BW; auto is N if all files can be in N.
        points: rows of the table, from touchdown to lift-off.
        overwrite: replace an existing table.
    """
    from hoof_env._output import check_folder, check_new
    from hoof_env.lab import average as mean
    from hoof_env.lab.columns import parse_mapping
    from hoof_env.lab.doubts import for_one
    from hoof_env.lab.read import read_record

    made = check_new(out, overwrite)
    mean.check_table(out)
    check_folder(out.parent)
    mapping = parse_mapping("--map", map)
    try:
        trials = [read_record(file, mapping, units_in, reverse, rate, mass, up, forward) for file in records]
    except HoofEnvError as error:
        # Its message names the options of `compare`, which end in -a and -b.
        raise type(error)(for_one(str(error), "").replace("--units", "--units-in")) from None
    stances = mean.average(trials, threshold, units, points)
    mean.write_table(stances, out)
    say(f"{mean.report(stances)}\n\n{out}: {points} rows, {size(out)}{made}")

"""Commands for records of gait laboratories."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from hoof_env.commands.console import say, size
from hoof_env.errors import HoofEnvError


@dataclass(frozen=True)
class ComparisonArgs:
    """Arguments of `hoof-env compare`."""

    a: Positional[Path]
    """the record that is taken as right: .csv, .txt, .tsv, .parquet (needs 'export'), .mot, .sto or .c3d."""
    b: Positional[Path]
    """the record of which the errors are reported."""
    out: Path = Path("compare.png")
    """the picture; ends in .png, .pdf or .svg."""
    map_a: tuple[str, ...] = ()
    """columns of A if they have other names than ours: time=Seconds force_x=-Fx force_y=Fz, or
    left_fore_force_y=LF_Fz ...; a - turns a column round, a + adds two, as left_force_y=p1_z+p3_z; Fz#2 is
    the second column Fz, #3 the third of all. left_fore=plate_1 renames a limb, left_fore=plate_1+plate_3 is
    the sum of two."""
    map_b: tuple[str, ...] = ()
    """columns of B."""
    units_a: str = "auto"
    """unit of A's forces: N, kN, N/kg, BW or %BW; auto takes the unit that the file states."""
    units_b: str = "auto"
    """unit of B's forces."""
    reverse_a: str = "auto"
    """components of A that point the other way: none, x, y or xy; auto turns both components of each limb
    with a vertical force that points into the ground."""
    reverse_b: str = "auto"
    """components of B that point the other way."""
    rate_a: float | None = None
    """samples a second of A, if it has no times, or times that cannot be read."""
    rate_b: float | None = None
    """samples a second of B."""
    mass_a: float | None = None
    """mass of A's animal [kg], for body weights, if the file does not state the weight."""
    mass_b: float | None = None
    """mass of B's animal [kg]."""
    up_a: str = "auto"
    """axis of A's file that points upward: x, y, z, -x, -y or -z; auto is y, and in a .c3d the normal of its
    plates."""
    up_b: str = "auto"
    """axis of B's file that points upward."""
    forward_a: str = "auto"
    """axis of A's file in which the animal travels, likewise; auto is x."""
    forward_b: str = "auto"
    """axis of B's file in which the animal travels."""
    gaps_a: str = "auto"
    """what missing values of A are: zero, or line for lines between their neighbours; auto takes those in
    swing as 0 and refuses others."""
    gaps_b: str = "auto"
    """what missing values of B are."""
    align: str = "stances"
    """stances lays each pair touchdown on touchdown, shift shifts B as a whole, none takes the times of the
    files."""
    threshold: float | None = None
    """vertical force that makes a stance [N]; 20, or 1 % of the weight if forces are in body weights and the
    weight is unknown."""
    units: str = "auto"
    """unit of the errors: N or BW; auto is N if both records can be in N."""
    overwrite: bool = False
    """replace an existing picture."""


def compare(args: Annotated[ComparisonArgs, arg(name="")]) -> None:
    """Compare ground reaction forces of two records, simulated or measured, limb by limb (needs 'lab')."""
    from hoof_env._output import check_new, new_file
    from hoof_env.lab.columns import parse_mapping
    from hoof_env.lab.compare import compare
    from hoof_env.lab.picture import check_picture, draw, report
    from hoof_env.lab.read import read_record

    made = check_new(args.out, args.overwrite)
    check_picture(args.out)
    map_a = parse_mapping("--map-a", args.map_a)
    map_b = parse_mapping("--map-b", args.map_b)
    of_a = (map_a, args.units_a, args.reverse_a, args.rate_a, args.mass_a)
    of_b = (map_b, args.units_b, args.reverse_b, args.rate_b, args.mass_b)
    a = read_record(args.a, *of_a, args.up_a, args.forward_a, args.gaps_a)
    b = read_record(args.b, *of_b, args.up_b, args.forward_b, args.gaps_b)
    comparison = compare(a, b, args.align, args.threshold, args.units)
    say(f"{report(comparison)}\n")
    with new_file(args.out, args.overwrite) as file:
        draw(comparison, file)
    say(f"{args.out}: {size(args.out)}{made}")


@dataclass(frozen=True)
class AverageArgs:
    """Arguments of `hoof-env average`."""

    records: Positional[tuple[Path, ...]]
    """one file or more that `hoof-env compare` reads; the options below hold for all of them."""
    out: Path
    """the table; ends in .csv."""
    map: tuple[str, ...] = ()
    """columns, as --map-a of `hoof-env compare`."""
    units_in: str = "auto"
    """unit of the files' forces: N, kN, N/kg, BW or %BW; auto takes the unit that each file states."""
    reverse: str = "auto"
    """components that point the other way: none, x, y or xy; auto turns both components of each limb with a
    vertical force that points into the ground."""
    rate: float | None = None
    """samples a second, if the files have no times."""
    mass: float | None = None
    """mass of the animal [kg], for body weights, if the files do not state the weight."""
    up: str = "auto"
    """axis of the files that points upward, as --up-a of `hoof-env compare`."""
    forward: str = "auto"
    """axis of the files in which the animal travels."""
    gaps: str = "auto"
    """what missing values are, as --gaps-a of `hoof-env compare`."""
    threshold: float | None = None
    """vertical force that makes a stance [N]; 20, or 1 % of the weight if forces are in body weights and the
    weight is unknown."""
    units: str = "auto"
    """unit of the table: N or BW; auto is N if all files can be in N."""
    points: int = 101
    """rows of the table, from touchdown to lift-off."""
    drop: tuple[str, ...] = ()
    """stances to be left out: first, the first of each file, which in an episode depends on its start; odd,
    stances that differ from the median duration by more than 25 %."""
    overwrite: bool = False
    """replace an existing table."""


def average(args: Annotated[AverageArgs, arg(name="")]) -> None:
    """Write the mean stance of several trials, and its standard deviation, as a table."""
    from hoof_env._output import check_folder, check_new, new_file
    from hoof_env.lab import average as mean
    from hoof_env.lab.axis_checks import for_one
    from hoof_env.lab.columns import parse_mapping
    from hoof_env.lab.read import read_record

    made = check_new(args.out, args.overwrite)
    mean.check_table(args.out)
    check_folder(args.out.parent)
    mapping = parse_mapping("--map", args.map)
    try:
        of_all = (
            mapping,
            args.units_in,
            args.reverse,
            args.rate,
            args.mass,
            args.up,
            args.forward,
            args.gaps,
        )
        trials = [read_record(file, *of_all) for file in args.records]
    except HoofEnvError as error:
        # Its message names the options of `compare`, which end in -a and -b.
        raise type(error)(for_one(str(error), "").replace("--units", "--units-in")) from None
    stances = mean.average(trials, args.threshold, args.units, args.points, args.drop)
    say(f"{mean.report(stances)}\n")
    with new_file(args.out, args.overwrite) as file:
        mean.write_table(stances, file)
    say(f"{args.out}: {args.points} rows, {size(args.out)}{made}")

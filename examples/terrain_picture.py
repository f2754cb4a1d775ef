"""A picture of a leg on changing ground, from an engine without an environment: docs/images/terrain.png.

pip install "hoof-env[render]" pillow, then python examples/terrain_picture.py"""

from PIL import Image

from hoof_env import Limb, Prescribed, Terrain, Trunk, TrunkEngine, load_gait, load_geometry
from hoof_env.ground.contact import load_ground
from hoof_env.record.columns import columns_of_engine
from hoof_env.record.instant import instants
from hoof_env.record.surroundings import Surroundings
from hoof_env.render.renderer import Renderer

leg = load_geometry("identified")
run = load_gait("run", "identified")
terrain = Terrain.through(
    x=[0.0, 1.0, 1.2, 2.4, 2.6, 3.0, 4.4, 4.5],
    height=[0.0, 0.0, 0.06, 0.06, 0.0, 0.0, 0.1, 0.1],
    stiffness=[1.0, 1.0, 0.4, 0.4, 1.0, 3.0, 3.0, 1.0],
    friction=[1.0, 1.0, 1.0, 1.0, 0.3, 0.3, 1.0, 1.0],
)
engine = TrunkEngine(Limb(leg, drive=Prescribed()), Trunk(height=leg.hip_height), load_ground(), terrain)
engine.reset(run, vx=2.0)
picture = Renderer(
    Surroundings(leg, terrain, weight_n=engine.weight, lift_off_n=0.05 * engine.weight),
)
for _ in range(59):
    record = engine.run(run.to_array(), steps=20)
    picture.add(instants(columns_of_engine(record, terrain, command=run.to_array())))
Image.fromarray(picture.frame()).save("terrain.png")

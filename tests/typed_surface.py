"""Uses every name of the package as a user would; mypy reads it, nothing runs it."""

from pathlib import Path
from typing import assert_type

import numpy as np

import evocity
from evocity.analysis import Individual, Run, View
from evocity.coding import Decoding, Encoding
from evocity.fitness import Family, Measure, Objective, Undefined
from evocity.operators import Operator, make
from evocity.report import write_report
from evocity.scene import Library, Scene
from evocity.search import Archive, Generation
from evocity.views.buildings import Buildings
from evocity.views.walls import Walls

# -- maps ----------------------------------------------------------------------------------------
assert_type(evocity.cities(), list[str])
lyon = evocity.read_map("lyon-1er", pixels=64, metres_per_pixel=2.0)
assert_type(lyon, evocity.CityMap)
assert_type(lyon.metres_per_pixel, float)
assert_type(lyon.origin, tuple[float, float] | None)
assert_type(lyon.height_rules, dict[str, int])
assert_type(lyon.shape, tuple[int, int])
assert_type(lyon.buildings, Buildings)
assert_type(lyon.walls, Walls)
built: np.ndarray = lyon.heights[lyon.built]
drawn: evocity.CityMap = evocity.CityMap(np.zeros((64, 64)), 2.0, name="open ground")
part = lyon.within(lyon.built)
assert_type(part.replace(part.heights, name="part"), evocity.CityMap)
evocity.write_map(lyon, "lyon.png", raw=True)
evocity.write_map(lyon, Path("lyon.gpkg"), streets=True)

# -- genomes -------------------------------------------------------------------------------------
kept: evocity.Condensation = evocity.Condensation(lyon.heights, lyon.built)
encoding = evocity.encode(lyon, block=4, condensation=kept)
assert_type(encoding, Encoding)
genome = encoding.genome
assert_type(genome, evocity.Genome)
assert_type(genome.pavement, evocity.Pavement)
assert_type(genome.cities, tuple[str, ...])
assert_type(evocity.Pavement(64, 64, 4).finest, int)
assert_type(evocity.split(genome, 2), evocity.Genome)
assert_type(evocity.merged(genome), evocity.Genome)
assert_type(evocity.read_genome("lyon.parquet"), evocity.Genome)
genome.write(Path("lyon.parquet"))
decoding = evocity.decode(genome, zoom=2)
assert_type(decoding, Decoding)
assert_type(decoding.city, evocity.CityMap)

# -- operators -----------------------------------------------------------------------------------
fuse = make("quarter_fusion", fill=0.5)
assert_type(fuse, Operator)
child = fuse([genome, genome], np.random.default_rng(7))
assert_type(child, evocity.Genome)


# -- measures ------------------------------------------------------------------------------------
@evocity.fitness(goal="max", unit="m")
def roof_spread(city: evocity.CityMap) -> float | Undefined:
    """How much the heights of roofs differ."""
    roofs = city.heights[city.built]
    return roofs.std() if roofs.size else Undefined("nothing is built")


@evocity.fitness(goal={"lowest": "min", "highest": None}, numbers=["lowest", "highest"])
def extremes(city: evocity.CityMap) -> dict[str, float]:
    """The lowest and the highest height."""
    return {"lowest": city.heights.min(), "highest": city.heights.max()}


assert_type(roof_spread, Measure)
assert_type(roof_spread(lyon), float)
assert_type(extremes, Measure | Family)
assert_type(evocity.fitness.gsi(lyon), float)
assert_type(evocity.fitness.integrity(lyon, genome=child, sources=[lyon]), float)
assert_type(evocity.fitness.measures(), list[Measure])
assert_type(evocity.fitness.load_file("mine.py"), list[Measure])
wanted: Objective = evocity.fitness.Objective(evocity.fitness.fsi, target=2.0)

# -- searches ------------------------------------------------------------------------------------
recipe = evocity.read_recipe("demo", population=8, generations=2)
assert_type(recipe, evocity.Recipe)
other = evocity.Recipe(
    parents=["lyon-1er", "montpellier-pas-du-loup"],
    fitness=["alignment", {"name": "gsi", "min": 0.3, "max": 0.5}],
    run={"population": 8, "generations": 2},
)
assert_type(other.operator("mutation"), Operator)
with evocity.Search(recipe, out="runs/by-hand", workers=0) as search:
    for generation in search:
        assert_type(generation, Generation)
        assert_type(generation.number, int)
        assert_type(generation.best, dict[str, float])
with evocity.deap_toolbox(recipe, workers=0) as toolbox:
    population = toolbox.population(n=4)

# -- runs ----------------------------------------------------------------------------------------
run = evocity.open_run("runs/by-hand")
assert_type(run, Run)
assert_type(run.genome(2), evocity.Genome)
assert_type(run.generations, range)
births = run.births(columns=["id", "status"])
view = run.view(of="alive", measures=["gsi"], order="-gsi")
assert_type(view, View)
view.selected = [2, 3]
view.brushes = {"gsi": [(0.2, 0.4)]}
picked: list[Individual] = view.selected
few = run.keep(3, of=[2, 3])
assert_type(few[0].built, dict[str, float])
assert_type(few.untraced, list[str])
run.save(few, "few.png")
evocity.plot.convergence(run)
archive = evocity.archive(run)
assert_type(archive, Archive)
assert_type(len(archive), int)
assert_type(evocity.pick("runs/by-hand", [2, 3], share=0.5), bool)
better = evocity.refine("runs/by-hand", 2, budget=20)
assert_type(better.genome, evocity.Genome)
assert_type(better.city, evocity.CityMap)
differ = [one.differs for one in evocity.replay(run, [2, 5]) if not one.same]
write_report("runs/by-hand")

# -- scenes, errors ------------------------------------------------------------------------------
scene = evocity.scene(lyon, squared=True)
assert_type(scene, Scene)
scene.write("lyon.glb")
assert_type(evocity.scene.Library.of(lyon, licence="ODbL 1.0"), Library)
try:
    evocity.read_map("nowhere.gpkg", attribution="© the surveyors")
except evocity.EvocityError as error:
    told: tuple[str, str, str] = error.found, error.expected, error.remedy

between = evocity.shapes.metamorphosis(evocity.shapes.known("koch"), evocity.shapes.known("levy"))
pieces: int = len(between(0.5).pieces(depth=3))
dimension: float = evocity.shapes.dimension_of(evocity.shapes.known("koch"))

"""Describe the objects that Blender makes of a file, as a line of JSON. Blender runs this script:
blender -b -P blender_objects.py -- FILE
"""

import builtins
import json
import sys

import addon_utils
import bpy
import numpy


def open_text(name: str, mode: str = "r", **how):
    """Open a file without the mode U, which Python no longer has."""
    return builtins.open(name, mode.replace("U", ""), **how)


def read(path: str) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    # Debian's Blender 3.4 runs newer Python and NumPy than its importers know
    if not hasattr(numpy, "bool"):
        numpy.bool = bool
    for name in ("io_scene_gltf2", "io_scene_x3d"):
        addon_utils.enable(name)
    if path.endswith(".glb"):
        bpy.ops.import_scene.gltf(filepath=path)
    elif path.endswith(".obj"):
        bpy.ops.wm.obj_import(filepath=path)
    else:
        import io_scene_x3d.import_x3d as importer

        importer.open = open_text
        bpy.ops.import_scene.x3d(filepath=path)


def described(item) -> dict:
    mesh, place = item.data, item.matrix_world
    points = [place @ vertex.co for vertex in mesh.vertices]
    mesh.calc_loop_triangles()
    volume = 0.0
    for triangle in mesh.loop_triangles:
        a, b, c = (points[k] for k in triangle.vertices)
        volume += a.dot(b.cross(c)) / 6
    return {
        "top": max(point.z for point in points),
        "volume": volume,
        "materials": [one.name for one in mesh.materials],
        "textured": len(mesh.uv_layers) > 0,
        "properties": {
            key: value for key, value in item.items() if isinstance(value, int | float | str)
        },
        "mesh": mesh.name,
    }


read(sys.argv[sys.argv.index("--") + 1])
found = {item.name: described(item) for item in bpy.data.objects if item.type == "MESH"}
print("OBJECTS", json.dumps(found))

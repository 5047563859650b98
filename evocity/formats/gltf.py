"""Binary glTF 2.0, y up: a node for each object, or a mesh for each group."""

from collections.abc import Sequence
from json.encoder import encode_basestring as quoted
from typing import Any

import numpy as np

from evocity.formats.facets import Facets, facets
from evocity.formats.gltf_document import KINDS, MOST, Document, bounds_of, short, to_json
from evocity.formats.gltf_properties import add_property_table
from evocity.formats.materials import (
    TILE,
    Material,
    is_surface,
    linear,
    materials_of,
    names_of,
    properties_of,
    tiles_of,
)
from evocity.formats.solids import About, Copies, Group, Mesh
from evocity.formats.trees import form_of, mesh_of, places_of

#: Objects from which on a scene has a mesh for each group.
MANY = 2000
_INSTANCING = "EXT_mesh_gpu_instancing"


def glb(
    groups: Sequence[Group], about: About, merge: bool | None = None, instances: bool = False
) -> bytes:
    """Write the bytes of a .glb (Khronos, glTF 2.0 specification): a node for each group, and below
    it a node for each object, with its name and properties. Colours are linear.

    merge : whether objects of a group are one mesh, with EXT_mesh_features and a property table;
        None merges scenes of `MANY` objects or more. With ``instances``, objects that share a shape
        stay apart.
    instances : whether objects of one shape are an EXT_mesh_gpu_instancing, and not nodes.

    A shape with two copies or more in a group has its own mesh, which the nodes of copies share.
    Trees and posts share a mesh too. A mirrored copy has a scale of x below 0, which reverses its
    triangles (3.7.4). Faces are flat: each has its own corners, with normals and texture
    coordinates (`evocity.formats.facets`).
    """
    place = {"crs": about.crs or "", "offset": list(about.offset), "attribution": about.attribution}
    asset = {"version": "2.0", "generator": "evocity"}
    if about.attribution:
        asset["copyright"] = about.attribution
    roots: list[int] = []
    # viewers such as Blender only keep the extras of a scene
    scene = {"name": about.name, "nodes": roots, "extras": place}
    members = {"asset": asset, "scene": 0, "scenes": [scene], "nodes": [], "meshes": []}
    document = Document(members)
    if merge is None:
        merge = sum(len(group) for group in groups if not is_surface(group)) >= MANY
    materials: dict[Material, int] = {}
    for group in groups:
        if len(group) and len(group.mesh.triangles):
            writer = _Writer(document, group, materials)
            node: dict[str, Any] = {"name": group.name}
            roots.append(document.append("nodes", node))
            if is_surface(group):
                node["mesh"] = writer.merged(group.mesh, writer.table() if merge else None)
            else:
                writer.place(node, merge, instances)
    return document.data()


class _Writer:
    """Adds meshes and nodes of one group to a document."""

    def __init__(self, document: Document, group: Group, materials: dict[Material, int]):
        self.document, self.group = document, group
        self._materials = [self._material(one, materials) for one in materials_of(group)]
        self._split = self._materials[0] != self._materials[1]

    def _material(self, material: Material, materials: dict[Material, int]) -> int:
        if material not in materials:
            look = {
                "baseColorFactor": [*linear(material.colour), 1.0],
                "metallicFactor": 0.0,
                "roughnessFactor": material.roughness,
            }
            value = {"name": material.name, "pbrMetallicRoughness": look}
            materials[material] = self.document.append("materials", value)
        return materials[material]

    # -- nodes -------------------------------------------------------------------------------------

    def place(self, node: dict, merge: bool, instances: bool) -> None:
        """Place the objects of the group below ``node``."""
        group, columns = self.group, properties_of(self.group)
        names, shared = names_of(group), _shared(group)
        form = form_of(group)
        if merge and not instances:
            shared[:] = False
        elif form is not None:
            shared[:] = True
        whole = mesh_of(group)
        single = whole.select(~shared[whole.owner]) if shared.any() else whole
        table = None
        if (merge and len(single.triangles)) or (instances and shared.any()):
            table = self.table()
        children: list[int] = []
        if len(single.triangles) and merge:
            node["mesh"] = self.merged(single, table)
        elif len(single.triangles):
            children += self._single(single, names, columns)
        if shared.any():
            copies = group.copies if form is None else _copies_of_form(group)
            mesh = copies.mesh if form is None else form
            used = np.flatnonzero(shared)
            if instances:
                children += self._instanced(copies, mesh, used, table)
            else:
                children += self._copies(copies, mesh, used, names, columns)
        if children:
            node["children"] = children

    def table(self) -> int:
        """Add a table with the names and properties of the group's objects; return its index."""
        columns = {"name": names_of(self.group)} | properties_of(self.group)
        return add_property_table(self.document, self.group.name, columns)

    def _single(self, mesh: Mesh, names: list[str], columns: dict[str, list]) -> list[int]:
        """Add nodes of objects with meshes of their own."""
        made = facets(mesh, np.array(tiles_of(self.group)))
        owners = np.flatnonzero(np.bincount(made.owner, minlength=len(self.group)))
        starts = np.searchsorted(made.owner, owners)
        plan = made.points[:, :2]
        low, high = (how.reduceat(plan, starts) for how in (np.minimum, np.maximum))
        origins = np.zeros((len(self.group), 3))
        origins[owners, :2] = np.round((low + high) / 2, 3)
        meshes, extras = self._meshes(made, origins, names), _extras(columns)
        texts = [
            f'{{"name":{quoted(names[k])},"mesh":{meshes[k]},'
            f'"translation":[{x},0.0,{0.0 - y}],"extras":{extras[k]}}}'
            for k, (x, y, _) in zip(owners.tolist(), origins[owners].tolist(), strict=True)
        ]
        return list(self.document.append_texts("nodes", texts))

    def _copies(
        self, copies: Copies, mesh: Mesh, used: np.ndarray, names: list[str], columns: dict
    ) -> list[int]:
        """Add nodes of the copies ``used``, which share the meshes of their shapes."""
        meshes = self._shapes(copies, mesh, used)
        moves, extras = _moves(copies, self.group.lift), _extras(columns)
        texts = []
        for k in used.tolist():
            value: dict[str, Any] = {"name": names[k], "mesh": meshes[int(copies.of[k])]}
            value |= {key: short(*rows[k].tolist()) for key, rows in moves.items()}
            texts.append(f'{to_json(value)[:-1]},"extras":{extras[k]}}}')
        return list(self.document.append_texts("nodes", texts))

    def _instanced(self, copies: Copies, mesh: Mesh, used: np.ndarray, table) -> list[int]:
        """Add a node of each shape, with the places of its copies."""
        document = self.document
        document.use(_INSTANCING, required=True)
        document.use("EXT_instance_features")
        meshes, moves = self._shapes(copies, mesh, used), _moves(copies, self.group.lift)
        nodes = []
        for shape, number in meshes.items():
            own = used[copies.of[used] == shape]
            attributes = {
                key.upper(): document.array(f"instances {key}", rows[own].astype(np.float32))
                for key, rows in moves.items()
            }
            ids = own.astype(np.float32)
            attributes["_FEATURE_ID_0"] = document.array("instances", ids)
            feature = {"featureCount": len(own), "attribute": 0, "propertyTable": table}
            extensions = {
                _INSTANCING: {"attributes": attributes},
                "EXT_instance_features": {"featureIds": [feature]},
            }
            node = {"name": copies.names[shape], "mesh": number, "extensions": extensions}
            nodes.append(document.append("nodes", node))
        return nodes

    # -- meshes ------------------------------------------------------------------------------------

    def _shapes(self, copies: Copies, mesh: Mesh, used: np.ndarray) -> dict[int, int]:
        shapes = np.unique(copies.of[used])
        chosen = mesh.select(np.isin(mesh.owner, shapes))
        made = facets(chosen, np.full(len(copies.names), TILE))
        return self._meshes(made, np.zeros((len(copies.names), 3)), list(copies.names))

    def _meshes(self, made: Facets, origins: np.ndarray, names: list[str]) -> dict[int, int]:
        """Add a mesh for each solid, in metres from its origin; their indices by solid."""
        primitives = self._primitives(made, made.points - origins[made.owner], made.owner, made.of)
        texts = [
            f'{{"name":{quoted(names[k])},"primitives":[{",".join(own)}]}}'
            for k, own in primitives.items()
        ]
        return dict(zip(primitives, self.document.append_texts("meshes", texts), strict=True))

    def merged(self, mesh: Mesh, table: int | None = None) -> int:
        """Add one mesh of all solids of a ``mesh``, with the property table ``table``."""
        made = facets(mesh, np.array(tiles_of(self.group)))
        chunk = _chunks(made.owner)
        primitives = self._primitives(made, made.points, chunk[made.owner], chunk[made.of], table)
        listed = ",".join([one for own in primitives.values() for one in own])
        text = f'{{"name":{quoted(self.group.name)},"primitives":[{listed}]}}'
        return self.document.append_texts("meshes", [text])[0]

    def _primitives(
        self,
        made: Facets,
        points: np.ndarray,
        corner: np.ndarray,
        triangle: np.ndarray,
        table: int | None = None,
    ) -> dict[int, list[str]]:
        """Add primitives: walls and roofs of each batch, which share their corners. The arrays
        ``corner`` and ``triangle`` are the batch of each corner and triangle, in rising order. With
        a property ``table``, corners have the number of their solid. Returns the primitives of
        each batch, as JSON."""
        document = self.document
        starts = np.flatnonzero(np.diff(corner, prepend=-1))
        numbers = corner[starts]
        counts = np.diff(np.r_[starts, len(corner)])
        placed = _y_up(points)
        uv = np.empty(made.uv.shape, np.float32)
        uv[:, 0], uv[:, 1] = made.uv[:, 0] + 0.0, 0.0 - made.uv[:, 1]  # glTF counts v downwards
        values = {"POSITION": placed, "NORMAL": _y_up(made.normals), "TEXCOORD_0": uv}
        if table is not None:
            document.use("EXT_mesh_features")
            values["_FEATURE_ID_0"] = made.owner.astype(np.float32)
        first = {}
        for name, rows in values.items():
            at, width = document.add(name, rows, "vertices"), rows[0].size
            places = (at + starts * rows.itemsize * width).tolist()
            bounds = bounds_of(placed, starts) if name == "POSITION" else None
            kind = KINDS[width]
            first[name] = document.accessors(name, places, counts.tolist(), "<f4", kind, bounds)
        # a scene has some thousands of primitives, so each is text at once
        template = ",".join([f'"{name}":%d' for name in first])
        rows = np.array(list(first.values())) + np.arange(len(numbers))[:, None]
        attributes = [template % tuple(row) for row in rows.tolist()]
        batch = np.cumsum(np.diff(triangle, prepend=triangle[:1]) != 0)
        local = made.triangles - starts.astype(made.triangles.dtype)[batch][:, None]
        indices = self._indices(local, batch, counts < MOST, made.of_roof & self._split)
        found = {}
        for k, number in enumerate(numbers.tolist()):
            shared = f'"attributes":{{{attributes[k]}}}'
            if table is not None:
                objects = len(np.unique(made.owner[starts[k] : starts[k] + counts[k]]))
                feature = {"featureCount": objects, "attribute": 0, "propertyTable": table}
                value = {"EXT_mesh_features": {"featureIds": [feature]}}
                shared += f',"extensions":{to_json(value)}'
            found[number] = [
                f'{{"indices":{own},"material":{self._materials[roof]},{shared}}}'
                for roof, own in indices[k]
            ]
        return found

    def _indices(
        self, local: np.ndarray, batch: np.ndarray, small: np.ndarray, roof: np.ndarray
    ) -> list[list[tuple[int, int]]]:
        """Add the triangles of batches, of 16 bits where a batch is ``small``. Returns for each
        batch its parts: 0 for walls or 1 for roofs, and the index of the accessor."""
        document = self.document
        found: list[list[tuple[int, int]]] = [[] for _ in range(len(small))]
        part = batch * 2 + roof
        if (np.diff(part) < 0).any():
            order = np.argsort(part, kind="stable")
            local, part = local[order], part[order]
        for chosen, kind in ((small, "<u2"), (~small, "<u4")):
            if not chosen.any():
                continue
            own = slice(None) if chosen.all() else chosen[part // 2]
            pool, step, parts = f"indices {kind}", 3 * int(kind[2]), part[own]
            at = document.add(pool, local[own].astype(kind).ravel(), "indices")
            starts = np.flatnonzero(np.diff(parts, prepend=-1))
            counts = 3 * np.diff(np.r_[starts, len(parts)])
            parts = parts[starts]
            places = (at + starts * step).tolist()
            first = document.accessors(pool, places, counts.tolist(), kind, "SCALAR")
            for k, key in enumerate(parts.tolist()):
                found[key // 2].append((key % 2, first + k))
        return found


def _shared(group: Group) -> np.ndarray:
    """Mark solids of a ``group`` that share a shape with another, bool ``(n,)``."""
    if group.copies is None:
        return np.zeros(len(group), bool)
    of = group.copies.of
    return (np.bincount(of + 1, minlength=1)[of + 1] > 1) & (of >= 0)


def _copies_of_form(group: Group) -> Copies:
    """Return trees or posts as copies of their form."""
    middles, sizes = places_of(group)
    count = len(group)
    return Copies(
        names=(group.name,),
        polygons=np.empty(0, object),
        heights=np.ones(1),
        of=np.zeros(count, int),
        scales=np.stack([sizes[:, 0], sizes[:, 0], sizes[:, 1]], axis=1),
        turns=np.zeros(count),
        places=middles,
    )


def _moves(copies: Copies, lift: np.ndarray) -> dict[str, np.ndarray]:
    """Return translations, rotations (quaternions) and scales of ``copies``, y up, which stand on
    ground of the heights ``lift``, metres."""
    x, y = copies.places.T
    along, across, up = copies.scales.T
    half, zero = copies.turns / 2, np.zeros(len(x))
    return {
        "translation": np.stack([x, lift, -y], axis=1),
        "rotation": np.stack([zero, np.sin(half), zero, np.cos(half)], axis=1),
        "scale": np.stack([along, up, across], axis=1),
    }


def _extras(columns: dict[str, list]) -> list[str]:
    """Return the properties of each object as JSON, without missing values."""
    labels, texts = [to_json(name) for name in columns], [_values(one) for one in columns.values()]
    if not any(None in values for values in columns.values()):
        template = ",".join([f"{label.replace('%', '%%')}:%s" for label in labels])
        return [f"{{{template % row}}}" for row in zip(*texts, strict=True)]
    return [
        f"{{{','.join([f'{a}:{b}' for a, b in zip(labels, row, strict=True) if b != 'null'])}}}"
        for row in zip(*texts, strict=True)
    ]


def _values(column: list) -> list[str]:
    """Return each value of a ``column`` as JSON."""
    kinds = set(map(type, column))
    if kinds <= {int, float, type(None)}:  # numbers hold no commas
        return to_json(column)[1:-1].split(",")
    if kinds == {str}:
        known = {value: quoted(value) for value in set(column)}
        return [known[value] for value in column]
    return [to_json(value) for value in column]


def _y_up(points: np.ndarray) -> np.ndarray:
    turned = np.empty((len(points), 3), np.float32)
    turned[:, :2] = points[:, ::2]
    turned[:, 2] = 0.0 - points[:, 1]
    return turned


def _chunks(owner: np.ndarray) -> np.ndarray:
    """Number batches of whole solids, by solid. A batch has so few corners that indices have 16
    bits, unless a single solid has more. ``owner``: the solid of each corner."""
    found, number, corners = [], 0, 0
    for own in np.bincount(owner).tolist():
        if corners and corners + own >= MOST:
            number, corners = number + 1, 0
        corners += own
        found.append(number)
    return np.array(found, int)

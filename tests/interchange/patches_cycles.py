"""Blender's Cycles (package bpy): the scenes of `interchange_patches`, and rubor's light over Cycles' on named patches.

    python patches_cycles.py SAMPLES FOLDER

Skin is the random walk for skin with the mean free paths of rubor's default profile; what it returns of an even sky is
measured on a flat piece at several angles, and its base colours are chosen so that it returns the albedo. Teeth
scatter as far as rubor's; other parts are diffuse under a rough dielectric. Writes cycles.f32 beside each rubor.f32 and patches.csv.
"""

import json
import math
import sys
from pathlib import Path

import bpy
import numpy

from volume_cycles import camera, empty, picture, units

# Diffuse mean free paths of R, G, B in mm at which Cycles' walk is as wide as the six Gaussians of d'Eon and Luebke 2007.
RADII_MM = (2.47, 0.43, 0.27)
# Of teeth: the mean distance of light is that of rubor's disk of 1.3 mm, 0.87 mm (that of the red above is 1.12 mm).
TOOTH_RADIUS_MM = 1.9
# Share of a scene's brightest patch below which a channel counts as black.
BLACK = 0.002


def material(name, kind, is_flat=None):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    out = tree.nodes.new("ShaderNodeOutputMaterial")
    color = tree.nodes.new("ShaderNodeVertexColor")
    color.layer_name = "albedo"
    if kind == 0:
        node = tree.nodes.new("ShaderNodeSubsurfaceScattering")
        # Sockets that a falloff has no use for are not found by name once it is set.
        for socket, value in (("Scale", 1.0), ("Radius", RADII_MM), ("IOR", 1.4), ("Roughness", 1.0), ("Anisotropy", 0.0)):
            node.inputs[socket].default_value = value
        node.falloff = "RANDOM_WALK_SKIN"
        target = node.inputs["Color"]
    else:
        node = tree.nodes.new("ShaderNodeBsdfPrincipled")
        node.inputs["IOR"].default_value = {1: 1.376, 2: 1.62, 3: 1.4}[kind]
        node.inputs["Roughness"].default_value = math.sqrt({1: 0.05, 2: 0.2, 3: 0.24}[kind])
        if kind == 2:
            node.subsurface_method = "RANDOM_WALK_SKIN"
            node.inputs["Subsurface Weight"].default_value = 1.0
            node.inputs["Subsurface Scale"].default_value = 1.0
            node.inputs["Subsurface Radius"].default_value = (TOOTH_RADIUS_MM,) * 3
        target = node.inputs["Base Color"]
    if is_flat is None:
        tree.links.new(color.outputs["Color"], target)
    else:
        target.default_value = (is_flat,) * 3 + (1,)
    tree.links.new(node.outputs[0], out.inputs["Surface"])
    return made


def add_mesh(scene, name, points, triangles, made, normals=None, albedo=None):
    data = bpy.data.meshes.new(name)
    data.from_pydata(points.tolist(), [], triangles.tolist())
    data.materials.append(made)
    if albedo is not None:
        layer = data.color_attributes.new("albedo", "FLOAT_COLOR", "POINT")
        layer.data.foreach_set("color", numpy.c_[albedo, numpy.ones(len(albedo))].astype("f4").ravel())
    if normals is not None:
        data.polygons.foreach_set("use_smooth", [True] * len(data.polygons))
        data.normals_split_custom_set_from_vertices(normals.tolist())
    scene.collection.objects.link(bpy.data.objects.new(name, data))


def even_sky(scene, radiance):
    world = bpy.data.worlds.new("sky")
    scene.world = world
    world.use_nodes = True
    for node in world.node_tree.nodes:
        if node.type == "BACKGROUND":
            node.inputs["Color"].default_value = (1, 1, 1, 1)
            node.inputs["Strength"].default_value = radiance


def inverse_albedo():
    """Base colours by albedo and by the cosine of the viewer: those of which a flat piece under an even sky returns the albedo.

    What the walk returns grows towards grazing views (by 15 to 25 % for skin), as nothing is refracted on its way out. Rubor's
    diffuse light is the same for all viewers, so that the two can be compared at any angle only without this."""
    bases = numpy.linspace(0.02, 1.0, 15)
    angles = numpy.radians([0, 30, 45, 60, 70, 78, 85])
    card = numpy.array([[-200, -200, 0], [200, -200, 0], [200, 200, 0], [-200, 200, 0]], float)
    # A slab: the walk needs an inside.
    slab = numpy.concatenate([card, card - [0, 0, 60]])
    faces = [[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]]
    for a, b in ((0, 1), (1, 2), (2, 3), (3, 0)):
        faces += [[a, a + 4, b], [b, a + 4, b + 4]]
    found = numpy.zeros((len(angles), len(bases), 3))
    for k, base in enumerate(bases):
        scene = empty(8, 8, 256)
        add_mesh(scene, "slab", slab, numpy.array(faces), material("skin", 0, float(base)))
        even_sky(scene, 1.0)
        for i, angle in enumerate(angles):
            camera(scene, (500 * math.sin(angle), 0, 500 * math.cos(angle)), (0, 0, 0), (0, 1, 0), 1)
            found[i, k] = picture(scene, 1).mean(axis=(0, 1))
    for i in (0, 3, 6):
        row = [(round(float(b), 2), [round(float(v), 3) for v in f]) for b, f in zip(bases[1::3], found[i, 1::3])]
        print(f"base colour, returned at {math.degrees(angles[i]):.0f} degrees:", row)

    def base_of(albedo, cosine):
        angle = numpy.arccos(numpy.clip(cosine, 0.0, 1.0))
        place = numpy.interp(angle, angles, numpy.arange(len(angles)))
        low = numpy.minimum(place.astype(int), len(angles) - 2)
        share = (place - low)[:, None]
        of_angle = numpy.empty((len(angles), *albedo.shape))
        for i in range(len(angles)):
            for c in range(3):
                of_angle[i, :, c] = numpy.interp(albedo[:, c], found[i, :, c], bases)
        each = numpy.arange(len(albedo))
        return (1 - share) * of_angle[low, each] + share * of_angle[low + 1, each]

    return base_of


def read_mesh(path):
    raw = path.read_bytes()
    vertices, triangles = numpy.frombuffer(raw[:8], "<u4")
    values = numpy.frombuffer(raw[8 : 8 + 36 * vertices], "<f4").reshape(-1, 9)
    indices = numpy.frombuffer(raw[8 + 36 * vertices :], "<u4").reshape(triangles, 4)
    return values, indices


def lamp(scene, described, unit):
    power = numpy.array(described["power"])
    strength = float(power.max())
    if strength <= 0:
        return
    directional = described["kind"] == "directional"
    data = bpy.data.lights.new("lamp", "SUN" if directional else "POINT")
    data.color = (power / strength).tolist()
    thing = bpy.data.objects.new("lamp", data)
    if directional:
        from mathutils import Vector

        data.angle = math.radians(described["angleDegrees"])
        data.energy = strength / unit["SUN"]
        thing.rotation_euler = Vector(described["direction"]).to_track_quat("-Z", "Y").to_euler()
    else:
        data.shadow_soft_size = described["radiusMm"]
        data.energy = 1e6 * strength / unit["POINT"]
        thing.location = described["positionMm"]
    scene.collection.objects.link(thing)


def drawn(folder, described, samples, unit, base_of, seed=0, bounces=None):
    size = described["size"]
    scene = empty(size[0], size[1], samples)
    if bounces is not None:
        scene.cycles.max_bounces = scene.cycles.diffuse_bounces = scene.cycles.glossy_bounces = bounces
    values, indices = read_mesh(folder / "mesh.bin")
    for kind in range(4):
        faces = indices[indices[:, 3] == kind][:, :3]
        if len(faces) == 0:
            continue
        used, faces = numpy.unique(faces, return_inverse=True)
        faces = faces.reshape(-1, 3)
        of = values[used]
        # Corners of one place are one vertex, or the walk finds no inside; texture seams have the same albedo.
        _, first, inverse = numpy.unique(of[:, :3], axis=0, return_index=True, return_inverse=True)
        faces, of = inverse.reshape(-1)[faces], of[first]
        faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
        to_viewer = numpy.array(described["camera"]["positionMm"]) - of[:, :3]
        to_viewer /= numpy.linalg.norm(to_viewer, axis=1)[:, None]
        cosine = (to_viewer * of[:, 3:6]).sum(axis=1)
        albedo = base_of(of[:, 6:9], cosine) if kind in (0, 2) else of[:, 6:9]
        add_mesh(scene, f"kind {kind}", of[:, :3], faces, material(f"kind {kind}", kind), of[:, 3:6], albedo)
    for each in described["lamps"]:
        lamp(scene, each, unit)
    if described["sky"] > 0:
        even_sky(scene, described["sky"])
    view = described["camera"]
    camera(scene, view["positionMm"], view["targetMm"], view["up"], view["fovYDegrees"])
    return picture(scene, seed)


def table(folder, scenes):
    """Prints and writes the ratios. A channel of a patch in which both have less than BLACK of the scene's brightest patch agrees: it shows
    as black in both, and its ratio says nothing."""
    lines = ["scene,patch,pixels,rubor_r,rubor_g,rubor_b,cycles_r,cycles_g,cycles_b,ratio_r,ratio_g,ratio_b"]
    within = {0.10: 0, 0.25: 0}
    count = 0
    for scene in scenes:
        described = json.loads((scene / "scene.json").read_text())
        shape = described["size"][1], described["size"][0]
        ours, theirs = (numpy.fromfile(scene / f"{n}.f32", "<f4").reshape(*shape, 3) for n in ("rubor", "cycles"))
        numbers = numpy.fromfile(scene / "patches.u8", "u1").reshape(shape)
        masks = [numbers == i for i in range(len(described["patches"]))]
        brightest = numpy.max([theirs[mask].mean(axis=0) for mask in masks], axis=0)
        for name, mask in zip(described["patches"], masks):
            a, b = ours[mask].mean(axis=0), theirs[mask].mean(axis=0)
            ratio = a / numpy.maximum(b, 1e-9)
            is_black = numpy.maximum(a, b) < BLACK * brightest
            count += 1
            worst = float(numpy.where(is_black, 0.0, numpy.abs(ratio - 1)).max())
            for bound in within:
                within[bound] += worst <= bound
            shown = ["black" if black else f"{r:.2f}" for r, black in zip(ratio, is_black)]
            print(f"{described['name']:12} {name:24} {int(mask.sum()):5}  " + " ".join(shown))
            numbers_text = ",".join(f"{v:.5f}" for v in (*a, *b)) + "," + ",".join(f"{r:.3f}" for r in ratio)
            lines.append(f"{described['name']},{name},{int(mask.sum())},{numbers_text}")
    (folder / "patches.csv").write_text("\n".join(lines) + "\n")
    print(", ".join(f"{n} of {count} patches within {round(100 * b)} % in every channel" for b, n in within.items()))


def main():
    samples, folder = int(sys.argv[1]), Path(sys.argv[2])
    scenes = sorted(p.parent for p in folder.glob("*/scene.json"))
    wanted = [s for s in scenes if not (s / "cycles.f32").exists()]
    if wanted:
        unit, base_of = units(), inverse_albedo()
        for scene in wanted:
            described = json.loads((scene / "scene.json").read_text())
            light = drawn(scene, described, samples, unit, base_of)
            light.astype("<f4").tofile(scene / "cycles.f32")
            print(f"{described['name']}: Cycles {bpy.app.version_string}", flush=True)
    table(folder, scenes)


if __name__ == "__main__":
    main()

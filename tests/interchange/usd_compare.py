"""OpenUSD (package usd-core): validates an exported layer and compares it with the reference.

    python usd_compare.py HEAD.usda REFERENCE_FOLDER

The reference is taken at frames (`interchange_reference HEAD.glb FOLDER frames`), where the layer has samples.
"""

import json
import sys
from pathlib import Path

import numpy
from pxr import Usd, UsdGeom, UsdSkel, UsdValidation

layer, folder = sys.argv[1], Path(sys.argv[2])
reference = json.loads((folder / "reference.json").read_text())
expected = numpy.fromfile(folder / "points.bin", "<f4").reshape(len(reference["times"]), -1, 3)

stage = Usd.Stage.Open(layer)
registry = UsdValidation.ValidationRegistry()
context = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators())
problems = [e for e in context.Validate(stage) if not e.HasNoError()]
for problem in problems:
    print(f"  {problem.GetType()} {problem.GetName()}: {problem.GetMessage()}")
print(f"OpenUSD {'.'.join(map(str, Usd.GetVersion()))} validators: {len(problems)} problems")

root = UsdSkel.Root(stage.GetDefaultPrim())
mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/rubor_head/Face"))
rest = numpy.array(mesh.GetPointsAttr().Get(), "f4")
cache = UsdSkel.Cache()
cache.Populate(root, Usd.TraverseInstanceProxies())
binding = UsdSkel.BindingAPI(mesh)
shapes = UsdSkel.BlendShapeQuery(binding)
skeleton = cache.GetSkelQuery(UsdSkel.Skeleton(stage.GetPrimAtPath("/rubor_head/Skeleton")))
animation = skeleton.GetAnimQuery()
names = [str(n) for n in animation.GetBlendShapeOrder()]
assert names == [str(n) for n in binding.GetBlendShapesAttr().Get()], "names of shapes"
missing = [n for n in names if n not in reference["names"]]
assert not missing, f"unknown shapes {missing}"

worst = 0.0
indices = shapes.ComputeBlendShapePointIndices()
offsets = shapes.ComputeSubShapePointOffsets()
for time, positions in zip(reference["times"], expected):
    code = Usd.TimeCode(round(time * reference["fps"]))
    weights = animation.ComputeBlendShapeWeights(code)
    sub_weights, shape_of, sub_of = shapes.ComputeSubShapeWeights(weights)
    points = rest.astype("f8")
    for weight, shape, sub in zip(sub_weights, shape_of, sub_of):
        if weight:
            moved = numpy.array(indices[shape])
            points[moved] += weight * numpy.array(offsets[sub], "f4")
    world = numpy.array(UsdGeom.Xformable(mesh).ComputeLocalToWorldTransform(code))
    found = points @ world[:3, :3] + world[3, :3]
    worst = max(worst, float(numpy.linalg.norm(found - positions, axis=1).max()))
share = worst / reference["heightMetres"]
print(f"OpenUSD: {share:.2e} of the head's height at most")
sys.exit(0 if share <= 1e-5 and not problems else 1)

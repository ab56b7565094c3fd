"""A scene that `rubor chart --volume --export` wrote, and how far pictures of other programs are from its light.

Folder of a scene: scene.json, surface.ply, blockers.ply, and pictures of f32 (rows from the top, RGB) with standard errors.
"""

import json
import sys
from pathlib import Path

import numpy

PATCHES = ["lit", "terminator", "thin", "shadow"]
# Two-sided 95 % of a normal distribution, and of Student's t with 7 degrees of freedom (8 passes).
NORMAL_95, STUDENT_95 = 1.960, 2.365
PASSES = 8


class Scene:
    def __init__(self, folder):
        self.folder = Path(folder)
        self.json = json.loads((self.folder / "scene.json").read_text())
        self.name = self.json["name"]
        self.width, self.height = self.json["size"]

    def picture(self, name):
        return numpy.fromfile(self.folder / f"{name}.f32", "<f4").reshape(self.height, self.width, 3)

    def patches(self):
        """Number of the patch of each pixel, 255 where there is no skin."""
        return numpy.fromfile(self.folder / "patches.u8", "u1").reshape(self.height, self.width)

    def coefficients(self):
        """Scattering and extinction, 1 / mm."""
        medium = self.json["medium"]
        scattering = numpy.array(medium["sigmaSPerMm"])
        return scattering, scattering + numpy.array(medium["sigmaAPerMm"])

    def mesh(self, which):
        """Corners in mm and triangles."""
        with open(self.folder / f"{which}.ply", "rb") as file:
            counts = []
            while (line := file.readline().strip()) != b"end_header":
                if line.startswith(b"element"):
                    counts.append(int(line.split()[2]))
            points = numpy.frombuffer(file.read(12 * counts[0]), "<f4").reshape(-1, 3)
            faces = numpy.frombuffer(file.read(), numpy.dtype([("n", "u1"), ("v", "<u4", 3)]))
        assert len(faces) == counts[1] and (faces["n"] == 3).all(), "triangles of a binary PLY"
        return points, faces["v"]


def compare(scene, passes, ours, program):
    """Ratios of light to ours by patch and channel, with confidence intervals of 95 %.

    passes: pictures of equal cost and independent noise, from which the standard error of their mean follows.
    ours: name of our picture of the same definition.
    """
    light, error = scene.picture(ours), scene.picture(f"{ours}-error")
    assert len(passes) == PASSES and passes.shape[1:] == light.shape, passes.shape
    patches = scene.patches()
    rows = []
    masks = [("all", patches < 255)] + [(name, patches == i) for i, name in enumerate(PATCHES)]
    for name, mask in masks:
        if mask.sum() < 25:
            continue
        expected = light[mask].mean(axis=0)
        own_error = numpy.sqrt((error[mask] ** 2).sum(axis=0)) / mask.sum()
        means = passes[:, mask].mean(axis=1)
        found, other_error = means.mean(axis=0), means.std(axis=0, ddof=1) / numpy.sqrt(PASSES)
        for c, channel in enumerate("RGB"):
            ratio = found[c] / expected[c]
            relative = lambda e, v: e / v if v > 0 else numpy.inf
            half = ratio * numpy.hypot(
                NORMAL_95 * relative(own_error[c], expected[c]), STUDENT_95 * relative(other_error[c], found[c])
            )
            rows.append({
                "scene": scene.name, "program": program, "patch": name, "channel": channel, "pixels": int(mask.sum()),
                "ratio": round(float(ratio), 5), "interval95": round(float(half), 5),
                "agrees": bool(abs(ratio - 1) <= half),
            })
    # Difference of pixels over what both noises let expect: 1 where nothing but noise differs. Every path that a program
    # traces is in every pass, so errors of pixels come from all passes.
    mask = patches < 255
    other = passes.std(axis=0, ddof=1) / numpy.sqrt(PASSES)
    expected = numpy.sqrt((error[mask] ** 2 + other[mask] ** 2).mean())
    difference = numpy.sqrt(((passes.mean(axis=0) - light)[mask] ** 2).mean())
    summary = {
        "scene": scene.name, "program": program, "patch": "pixels", "pixels": int(mask.sum()),
        "relativeRmse": round(float(difference / numpy.sqrt((light[mask] ** 2).mean())), 5),
        "overNoise": round(float(difference / expected), 4),
    }
    return rows + [summary]


def write(scene, name, program, passes):
    """Keeps pictures of a program; the comparison reads them."""
    numpy.stack(passes).astype("<f4").tofile(scene.folder / f"{name}-passes.f32")
    (scene.folder / f"{name}.json").write_text(json.dumps({"program": program}) + "\n")
    print(f"{scene.name}: {program}", flush=True)


def table(folder):
    """All comparisons below a folder as agreement.csv, and how many of them agree."""
    lines = ["program,still,patch,channel,pixels,ratio,interval95,over_noise"]
    agreeing, all_ratios = {}, {}
    for name, ours in (("mitsuba", "scattered"), ("cycles", "scattered-all-facets")):
        for file in sorted(Path(folder).glob(f"*/{name}.json")):
            scene = Scene(file.parent)
            flat = numpy.fromfile(scene.folder / f"{name}-passes.f32", "<f4")
            passes = flat.reshape(PASSES, scene.height, scene.width, 3).astype("f8")
            for row in compare(scene, passes, ours, json.loads(file.read_text())["program"]):
                head = [row["program"], row["scene"], row["patch"], row.get("channel", ""), row["pixels"]]
                if row["patch"] == "pixels":
                    lines.append(",".join(map(str, [*head, "", "", row["overNoise"]])))
                    continue
                lines.append(",".join(map(str, [*head, row["ratio"], row["interval95"], ""])))
                agreeing.setdefault(row["program"], []).append(row["agrees"])
                if row["patch"] == "all":
                    all_ratios.setdefault(row["program"], []).append(row["ratio"])
    (Path(folder) / "agreement.csv").write_text("\n".join(lines) + "\n")
    for program, agrees in agreeing.items():
        ratios = all_ratios[program]
        mean = sum(ratios) / len(ratios)
        print(f"{program}: {sum(agrees)} of {len(agrees)} intervals of 95 % hold 1, mean ratio of pictures {mean:.4f}")


if __name__ == "__main__":
    table(sys.argv[1])

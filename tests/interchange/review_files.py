"""OpenEXR and OpenTimelineIO (packages OpenEXR, opentimelineio, otio-cmx3600-adapter): read what a run with --format exr holds.

    python review_files.py RUN [NOTES.json NOTES.edl]

NOTES: what the page exported (`review.mjs`).
"""

import hashlib
import json
import sys
from pathlib import Path

import numpy
import OpenEXR
import opentimelineio as otio

run = Path(sys.argv[1])
faults = []


def expect(holds, what):
    if not holds:
        faults.append(what)


job = json.loads((run / "job.json").read_text())
width, height = job["settings"]["output"]["size"]
files = sorted(path for path in run.glob("frame.*.exr") if path.name.count(".") == 2)
pictures = sorted(run.glob("frame.*.png"))
expect(len(files) == len(pictures) > 0, f"{len(files)} files of layers, {len(pictures)} pictures")

names = None
for path in files:
    with OpenEXR.File(str(path), separate_channels=True) as file:
        # What the file holds goes with it.
        header, channels = dict(file.header()), {name: channel.pixels for name, channel in file.channels().items()}
    window = [[int(v) for v in corner] for corner in header["dataWindow"]]
    expect(window == [[0, 0], [width - 1, height - 1]], f"{path.name}: window {window}")
    expect(header["compression"] == OpenEXR.ZIP_COMPRESSION, f"{path.name}: {header['compression']}")
    primaries = [round(float(v), 4) for v in numpy.ravel(header["chromaticities"])]
    expect(primaries == [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329], f"{path.name}: chromaticities {primaries}")
    rate = header["framesPerSecond"]
    expect(abs(float(rate) - job["sequence"]["fps"]) < 1e-3, f"{path.name}: {rate} frames a second")
    names = names or list(channels)
    expect(list(channels) == names, f"{path.name}: other channels than {files[0].name}")

    kinds = {"R": "float16", "Z": "float32", "id.part": "uint32", "mask.skin": "float16", "chromophores.hemoglobin": "float32"}
    for name, kind in kinds.items():
        expect(str(channels[name].dtype) == kind, f"{path.name}: {name} is {channels[name].dtype}")
        expect(channels[name].shape == (height, width), f"{path.name}: {name} is {channels[name].shape}")
    light = {name: channels[name].astype("f8") for name in channels if channels[name].dtype == numpy.float16}
    skin = channels["mask.skin"] == 1
    expect(skin.sum() > width * height / 20, f"{path.name}: {skin.sum()} pixels of skin")
    total = (light["diffuse.R"] * light["albedo.R"] + light["specular.R"]) * (1 - light["hair.A"]) + light["hair.R"]
    bound = numpy.where(light["hair.A"] > 0, 0.025, 4e-3) * total + 1e-4
    share = (abs(total - light["R"]) < bound)[channels["id.part"] > 0].mean()
    expect(share > 0.999, f"{path.name}: beauty is the sum of its parts in {share:.1%} of the head")
    through = light["transmittance.R"]
    expect((through >= 0).all() and (through <= 1.001 * light["irradiance.R"] + 1e-4).all(), f"{path.name}: light through")
    length = numpy.sqrt(sum(light[f"N.{axis}"] ** 2 for axis in "XYZ"))[skin]
    expect(abs(length - 1).max() < 0.15, f"{path.name}: normals of length {length.min()} to {length.max()}")
    blood = channels["chromophores.hemoglobin"][skin]
    expect(0 <= blood.min() and blood.max() <= 0.32, f"{path.name}: blood {blood.min()} to {blood.max()}")
    depth = channels["Z"]
    expect(numpy.isfinite(depth[skin]).all() and (depth[skin] > 0.1).all(), f"{path.name}: depth of skin")
groups = sorted({name.split(".")[0] for name in names or []})
print(f"OpenEXR {OpenEXR.__version__}: {len(files)} files, layers {' '.join(groups)}")

timeline = otio.adapters.read_from_file(str(run / "sequence.otio"))
(clip,) = timeline.find_clips()
media = clip.media_reference
count = media.number_of_images_in_sequence()
expect(count == len(pictures), f"the timeline has {count} frames, the folder {len(pictures)}")
for number in (0, count - 1):
    address = media.target_url_for_image_number(number)
    expect((run / address).is_file(), f"the timeline names {address}, which is not there")
expect(timeline.duration().to_seconds() == len(pictures) / job["sequence"]["fps"], f"it lasts {timeline.duration()}")
video = clip.media_references().get("video")
expect((video is not None) == (run / "video.mp4").is_file(), "the video is there, or is named, but not both")
peaks = [m for m in clip.markers if m.color == otio.schema.MarkerColor.RED]
expect(len(peaks) > 0, "no peak is marked")
for mark in clip.markers:
    expect(clip.available_range().contains(mark.marked_range, 0), f"{mark.name} is outside of the clip")
print(f"OpenTimelineIO {otio.__version__}: {count} frames, {len(clip.markers)} markers, {len(peaks)} peaks")

manifest = json.loads((run / "manifest.json").read_text())
for entry in manifest["files"]:
    data = (run / entry["file"]).read_bytes()
    expect(len(data) == entry["bytes"], f"{entry['file']}: {len(data)} bytes, not {entry['bytes']}")
    expect(hashlib.sha256(data).hexdigest() == entry["sha256"], f"{entry['file']}: another checksum")
expect({path.name for path in run.iterdir()} == {e["file"] for e in manifest["files"]} | {"manifest.json"}, "the manifest lists other files")
print(f"manifest: {len(manifest['files'])} files")

if len(sys.argv) > 3:
    notes = json.loads(Path(sys.argv[2]).read_text())["notes"]
    edit = otio.adapters.read_from_file(sys.argv[3], rate=round(job["sequence"]["fps"]))
    (clip,) = edit.find_clips()
    found = [(int(m.marked_range.start_time.value), m.metadata.get("cmx_3600", {}).get("color"), m.name) for m in clip.markers]
    expect(len(found) == len(notes), f"{len(notes)} notes, markers {found}")
    for note, (start, color, name) in zip(notes, found):
        expect(note["text"] in name, f"the marker says {name}, the note {note['text']}")
    print(f"edit list: {found}")

for fault in faults:
    print(f"FAULT: {fault}", file=sys.stderr)
sys.exit(1 if faults else 0)

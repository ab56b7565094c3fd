// Pixels of an invocation in a pass over the whole image: one in each of four blocks of 8 x 8.
// A device starts a bounded number of invocations a clock; with one pixel each, a pass that only copies is held up by
// that and not by memory (1920 x 1080 on an H100: 24.8 microseconds, with four pixels 11.9).

const BLOCKS = 4u;

fn block_pixel(group: vec3u, local: vec3u, block: u32) -> vec2u {
    return 8u * (2u * group.xy + vec2u(block & 1u, block >> 1u)) + local.xy;
}

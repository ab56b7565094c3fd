// Blending of one or two samples a pixel over the whole image, their mean, and the mix with the previous frame.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var output: texture_storage_2d<OUTPUT_FORMAT, write>;
@group(0) @binding(2) var<storage, read> bits_a: array<vec2<u32>>;
@group(0) @binding(3) var color_a: texture_2d<f32>;
@group(0) @binding(4) var weights_a: texture_2d<f32>;
// The second sample where PAIR, or the first one again.
@group(0) @binding(5) var<storage, read> bits_b: array<vec2<u32>>;
@group(0) @binding(6) var color_b: texture_2d<f32>;
@group(0) @binding(7) var weights_b: texture_2d<f32>;
// What TEMPORAL needs: motion since the previous frame in pixels; light and speed of the previous frame; the same of
// this frame, to be kept. Single texels otherwise.
@group(0) @binding(8) var velocity: texture_2d<f32>;
@group(0) @binding(9) var previous_light: texture_2d<f32>;
@group(0) @binding(10) var previous_speed: texture_2d<f32>;
@group(0) @binding(11) var kept_light: texture_storage_2d<rgba16float, write>;
@group(0) @binding(12) var kept_speed: texture_storage_2d<r32float, write>;

struct Position {
    p: vec2<i32>,
    own: u32,
    below: u32,
    right: u32,
    shift: u32,
    has_below: bool,
    has_right: bool,
}

fn position(p: vec2<u32>) -> Position {
    let row = p.y * params.words.x;
    var q: Position;
    q.p = vec2<i32>(p);
    q.own = row + (p.x >> 5u);
    q.has_below = p.y + 1u < params.size.y;
    q.below = select(q.own, q.own + params.words.x, q.has_below);
    q.has_right = p.x + 1u < params.size.x;
    q.right = select(q.own, row + ((p.x + 1u) >> 5u), q.has_right);
    q.shift = p.x & 31u;
    return q;
}

// Edges above, below, left of and right of the pixel.
fn edges_around(q: Position, own: vec2<u32>, below: u32, right: u32) -> vec4<bool> {
    let top_left = ((own >> vec2(q.shift)) & vec2(1u)) == vec2(1u);
    return vec4(
        top_left.x,
        q.has_below && ((below >> q.shift) & 1u) == 1u,
        top_left.y,
        q.has_right && ((right >> ((q.shift + 1u) & 31u)) & 1u) == 1u,
    );
}

fn shares_a(q: Position) -> vec4<f32> {
    let edges = edges_around(q, bits_a[q.own], bits_a[q.below].x, bits_a[q.right].y);
    if any(edges) {
        let found = neighbor_weights(weights_a, q.p, edges);
        if any(found > vec4(0.0)) {
            return neighbor_shares(found);
        }
    }
    return vec4(0.0);
}

fn shares_b(q: Position) -> vec4<f32> {
    let edges = edges_around(q, bits_b[q.own], bits_b[q.below].x, bits_b[q.right].y);
    if any(edges) {
        let found = neighbor_weights(weights_b, q.p, edges);
        if any(found > vec4(0.0)) {
            return neighbor_shares(found);
        }
    }
    return vec4(0.0);
}

// Motion of the fastest of a pixel and its eight neighbours. On the outline of what moves, samples see it in one frame
// and what lies behind in the next; both frames have to follow the same of the two.
fn motion_at(p: vec2<i32>) -> vec2<f32> {
    let last = vec2<i32>(params.size) - 1;
    var fastest = vec2(0.0);
    for (var i = 0; i < 9; i++) {
        let q = clamp(p + vec2(i % 3, i / 3) - 1, vec2(0), last);
        let other = textureLoad(velocity, q, 0).xy;
        if dot(other, other) > dot(fastest, fastest) {
            fastest = other;
        }
    }
    return fastest;
}

// Speed in units of SPEED_UNIT_PX a frame.
fn speed_at(p: vec2<i32>) -> f32 {
    return length(motion_at(p)) / SPEED_UNIT_PX;
}

// Speeds are mixed like the colours, so that blended pixels do not leave trails (section 10.4.4).
fn mixed_speed(p: vec2<i32>, shares: vec4<f32>) -> f32 {
    var speed = speed_at(p) * (1.0 - shares.x - shares.y - shares.z - shares.w);
    if any(shares > vec4(0.0)) {
        speed += speed_at(p - vec2(0, 1)) * shares.x + speed_at(p + vec2(0, 1)) * shares.y;
        speed += speed_at(p - vec2(1, 0)) * shares.z + speed_at(p + vec2(1, 0)) * shares.w;
    }
    return speed;
}

struct Previous {
    light: vec4<f32>,
    speed: f32,
}

// Bilinear, as speeds are stored in a format that samplers need not filter.
fn previous_at(position_px: vec2<f32>) -> Previous {
    let last = vec2<i32>(params.size) - 1;
    let base = floor(position_px - 0.5);
    let part = position_px - 0.5 - base;
    var sum = Previous(vec4(0.0), 0.0);
    for (var i = 0; i < 4; i++) {
        let step = vec2(i & 1, i >> 1u);
        let share = select(1.0 - part, part, step == vec2(1));
        let q = clamp(vec2<i32>(base) + step, vec2(0), last);
        sum.light += textureLoad(previous_light, q, 0) * (share.x * share.y);
        sum.speed += textureLoad(previous_speed, q, 0).x * (share.x * share.y);
    }
    return sum;
}

// Mean of two colours; `part` is the share of the second.
fn mean(a: vec4<f32>, b: vec4<f32>, part: f32) -> vec4<f32> {
    let alpha = a.a + (b.a - a.a) * part;
    let weighed = a.rgb * (a.a * (1.0 - part)) + b.rgb * (b.a * part);
    return vec4(select(mix(a.rgb, b.rgb, part), weighed / alpha, STRAIGHT_ALPHA && alpha > 0.0), alpha);
}

@compute @workgroup_size(8, 8)
fn resolve(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.size) {
        return;
    }
    let q = position(id.xy);
    let stored = textureLoad(color_a, q.p, 0);
    var shares = shares_a(q);
    // A pixel that nothing changes keeps its bits.
    var same = all(shares == vec4(0.0));
    var light = decoded(stored);
    if !same {
        light = mixed(color_a, q.p, shares);
    }
    if PAIR {
        let stored_b = textureLoad(color_b, q.p, 0);
        let more = shares_b(q);
        if any(more > vec4(0.0)) {
            light = mean(light, mixed(color_b, q.p, more), 0.5);
            same = false;
        } else if !same || any(stored_b != stored) {
            light = mean(light, decoded(stored_b), 0.5);
            same = false;
        }
        shares = 0.5 * (shares + more);
    }
    if TEMPORAL {
        let speed = mixed_speed(q.p, shares);
        // The largest half.
        textureStore(kept_light, q.p, min(light, vec4(65504.0)));
        textureStore(kept_speed, q.p, vec4(speed, 0.0, 0.0, 0.0));
        let origin = vec2<f32>(q.p) + 0.5 - motion_at(q.p);
        if params.history_valid == 1u && all(origin >= vec2(0.0)) && all(origin <= vec2<f32>(params.size)) {
            let previous = previous_at(origin);
            // Equations 10.6 and 10.7.
            let part = 0.5 * max(0.0, 1.0 - REPROJECTION_WEIGHT * sqrt(abs(speed - previous.speed)));
            // What differs by no more than the history's rounding is no difference.
            if any(abs(previous.light - light) > abs(light) * HISTORY_PRECISION) {
                light = mean(light, previous.light, part);
                same = same && part == 0.0;
            }
        }
    }
    textureStore(output, q.p, select(encoded(light), stored, same));
}

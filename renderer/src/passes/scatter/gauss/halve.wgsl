// Light at a half, a quarter and an eighth of its size. Concatenated after view.wgsl and common.wgsl.

// rgb, a = depth in mm from view.depth_origin_mm on.
@group(0) @binding(0) var source: texture_2d<f32>;
@group(0) @binding(1) var half: texture_storage_2d<rgba16float, write>;
@group(0) @binding(2) var quarter: texture_storage_2d<rgba16float, write>;
@group(0) @binding(3) var eighth: texture_storage_2d<rgba16float, write>;

const SIDE = 16u;

// What the workgroup made last, row by row.
var<workgroup> made: array<array<vec4f, SIDE>, SIDE>;

// The mean over the nearest surface of four texels.
fn mean(four: array<vec4f, 4>) -> vec4f {
    let nearest = min(min(four[0].a, four[1].a), min(four[2].a, four[3].a));
    var sum = vec4f(0.0);
    var count = 0.0;
    for (var i = 0u; i < 4u; i++) {
        if four[i].a - nearest < ONE_SURFACE_MM {
            sum += four[i];
            count += 1.0;
        }
    }
    return sum / count;
}

fn texel(at: vec2u) -> vec4f {
    if any(at >= textureDimensions(source)) {
        return vec4f(0.0, 0.0, 0.0, FAR_MM);
    }
    let light = textureLoad(source, at, 0);
    return vec4f(min(light.rgb, vec3f(HALF_MAX)), light.a);
}

fn mean_of_made(at: vec2u) -> vec4f {
    let p = 2u * at;
    return mean(array(made[p.y][p.x], made[p.y][p.x + 1u], made[p.y + 1u][p.x], made[p.y + 1u][p.x + 1u]));
}

// As the images keep it, so that a level is the mean of what the one before holds.
fn rounded(light: vec4f) -> vec4f {
    return vec4f(unpack2x16float(pack2x16float(light.rg)), unpack2x16float(pack2x16float(light.ba)));
}

@compute @workgroup_size(SIDE, SIDE)
fn halve(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let at = local.xy;
    let p = 2u * (SIDE * group.xy + at);
    var light = rounded(mean(array(texel(p), texel(p + vec2u(1u, 0u)), texel(p + vec2u(0u, 1u)), texel(p + 1u))));
    textureStore(half, SIDE * group.xy + at, light);
    made[at.y][at.x] = light;
    workgroupBarrier();

    let makes_quarter = all(at < vec2u(SIDE / 2u));
    if makes_quarter {
        light = rounded(mean_of_made(at));
        textureStore(quarter, SIDE / 2u * group.xy + at, light);
    }
    workgroupBarrier();
    if makes_quarter {
        made[at.y][at.x] = light;
    }
    workgroupBarrier();
    if all(at < vec2u(SIDE / 4u)) {
        textureStore(eighth, SIDE / 4u * group.xy + at, mean_of_made(at));
    }
}

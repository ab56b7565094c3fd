// One invocation a vertex: normal from the triangles around its point, tangent from those that share the vertex.
// Concatenated after surface.wgsl.

@group(0) @binding(0) var<storage, read> positions: array<vec4f>;
@group(0) @binding(1) var<storage, read> vertices: array<Vertex>;
// xyz = vertices, w = material.
@group(0) @binding(2) var<storage, read> triangles: array<vec4u>;
@group(0) @binding(3) var<storage, read> ring_starts: array<u32>;
@group(0) @binding(4) var<storage, read> ring: array<u32>;
@group(0) @binding(5) var<storage, read_write> frames: array<SurfaceFrame>;

fn texture_coordinate(v: Vertex) -> vec2f { return vec2f(v.u, v.v); }

@compute @workgroup_size(64)
fn surface_frames(@builtin(global_invocation_id) id: vec3u) {
    let vertex = id.x;
    if vertex >= arrayLength(&vertices) {
        return;
    }
    let point = vertices[vertex].point;
    var normal = vec3f(0.0);
    var tangent = vec3f(0.0);
    var bitangent = vec3f(0.0);
    let end = ring_starts[point + 1u];
    for (var i = ring_starts[point]; i < end; i++) {
        let corners = triangles[ring[i]].xyz;
        let a = vertices[corners.x];
        let b = vertices[corners.y];
        let c = vertices[corners.z];
        let p = positions[a.point].xyz;
        let e1 = positions[b.point].xyz - p;
        let e2 = positions[c.point].xyz - p;
        normal += cross(e1, e2);
        if any(corners == vec3u(vertex)) {
            let d1 = texture_coordinate(b) - texture_coordinate(a);
            let d2 = texture_coordinate(c) - texture_coordinate(a);
            let orientation = select(1.0, -1.0, d1.x * d2.y - d1.y * d2.x < 0.0);
            tangent += orientation * (e1 * d2.y - e2 * d1.y);
            bitangent -= orientation * (e2 * d1.x - e1 * d2.x);
        }
    }
    let n = select(vec3f(0.0, 0.0, 1.0), normalize(normal), dot(normal, normal) > 0.0);
    var t = tangent - n * dot(n, tangent);
    if dot(t, t) > 0.0 {
        t = normalize(t);
    } else {
        // Any direction across the normal.
        t = normalize(cross(n, select(vec3f(1.0, 0.0, 0.0), vec3f(0.0, 1.0, 0.0), abs(n.x) > 0.5)));
    }
    let bitangent_sign = select(1.0, -1.0, dot(cross(n, t), bitangent) < 0.0);
    frames[vertex] = SurfaceFrame(n, positions[point].w, t, bitangent_sign);
}

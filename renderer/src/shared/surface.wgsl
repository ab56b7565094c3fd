// Geometry of a head as the passes read it. Needs view.wgsl.

// Corner of a triangle: x = point index (bits), yz = texture coordinate.
struct Vertex {
    point: u32,
    u: f32,
    v: f32,
    padding: u32,
}

// Deformed frame of a vertex in world space: unit normal, unit tangent, and the sign of the bitangent
// (bitangent = sign * cross(normal, tangent), towards smaller v).
struct SurfaceFrame {
    normal: vec3f,
    occlusion: f32,
    tangent: vec3f,
    bitangent_sign: f32,
}

// A visible triangle in the id image: 0 is nothing, else head in the upper 5 bits and triangle + 1 below.
const HEAD_SHIFT = 27u;
const TRIANGLE_MASK = 0x07ffffffu;

// Barycentric coordinates where the ray origin + t * ray meets the plane of a triangle, given the corners relative
// to the origin. Ratios of the volumes of the three tetrahedra ray-edge; exact under perspective.
fn ray_barycentrics(a: vec3f, b: vec3f, c: vec3f, ray: vec3f) -> vec3f {
    let v = vec3f(dot(ray, cross(b, c)), dot(ray, cross(c, a)), dot(ray, cross(a, b)));
    return v / (v.x + v.y + v.z);
}

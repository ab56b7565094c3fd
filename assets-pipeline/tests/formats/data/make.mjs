// Makes the inputs of these tests: a sheet with two shapes and a painted texture, by itself and compressed.
//
//   npm i @gltf-transform/core @gltf-transform/extensions @gltf-transform/cli@4.5.1 gltfpack@1.3.0 sharp
//   node make.mjs
//   gltf-transform meshopt plain.glb meshopt.glb --level high
//   gltf-transform draco plain.glb draco.glb
//   gltfpack -i plain.glb -o pack.glb -cc -kn -km -ke
//   gltfpack -i plain.glb -o packz.glb -cz -kn -km -ke
//   basisu -ktx2 -q 255 gradient.png -output_file etc1s.ktx2                     (Basis Universal 1.16.4)
//   basisu -ktx2 -uastc -uastc_level 2 gradient.png -output_file uastc.ktx2
//   basisu -ktx2 -uastc -ktx2_no_zstandard gradient.png -output_file uastc_stored.ktx2
import { Document, NodeIO } from '@gltf-transform/core';
import { ALL_EXTENSIONS } from '@gltf-transform/extensions';
import sharp from 'sharp';
const n = 9;
const doc = new Document();
const buffer = doc.createBuffer();
const pos = [], uv = [], nor = [], idx = [], m0 = [], m1 = [];
for (let y = 0; y < n; y++) for (let x = 0; x < n; x++) {
  const u = x / (n - 1), v = y / (n - 1);
  pos.push(0.2 * (u - 0.5), 0.25 * (0.5 - v), 0.04 * Math.cos(Math.PI * (u - 0.5)) * Math.cos(Math.PI * (v - 0.5)));
  uv.push(u, v);
  nor.push(0, 0, 1);
  const low = v > 0.6 ? (v - 0.6) : 0;
  m0.push(0, -0.1 * low, -0.02 * low);
  const up = v < 0.3 && u > 0.5 ? 0.3 - v : 0;
  m1.push(0, 0.05 * up, 0.03 * up);
}
for (let y = 0; y + 1 < n; y++) for (let x = 0; x + 1 < n; x++) {
  const a = y * n + x, b = a + 1, c = a + n, d = c + 1;
  idx.push(a, c, b, b, c, d);
}
const acc = (type, a) => doc.createAccessor().setType(type).setArray(new Float32Array(a)).setBuffer(buffer);
const w = 16;
const px = Buffer.alloc(w * w * 4);
for (let y = 0; y < w; y++) for (let x = 0; x < w; x++) px.set([200, 40 + 12 * x, 40 + 12 * y, 255], 4 * (y * w + x));
const png = await sharp(px, { raw: { width: w, height: w, channels: 4 } }).png().toBuffer();
const tex = doc.createTexture('paint').setImage(png).setMimeType('image/png');
const mat = doc.createMaterial('Paint').setBaseColorTexture(tex).setRoughnessFactor(0.6).setMetallicFactor(0);
const prim = doc.createPrimitive().setAttribute('POSITION', acc('VEC3', pos)).setAttribute('NORMAL', acc('VEC3', nor)).setAttribute('TEXCOORD_0', acc('VEC2', uv))
  .setIndices(doc.createAccessor().setType('SCALAR').setArray(new Uint16Array(idx)).setBuffer(buffer)).setMaterial(mat);
for (const [i, m] of [m0, m1].entries()) prim.addTarget(doc.createPrimitiveTarget(['jawOpen', 'browOuterUpLeft'][i]).setAttribute('POSITION', acc('VEC3', m)));
const mesh = doc.createMesh('Sheet').addPrimitive(prim).setExtras({ targetNames: ['jawOpen', 'browOuterUpLeft'] });
mesh.setWeights([0, 0]);
doc.createScene('Sheet').addChild(doc.createNode('Sheet').setMesh(mesh));
await new NodeIO().registerExtensions(ALL_EXTENSIONS).write('plain.glb', doc);

// RUBOR_facial_appearance in three.js: blood and wrinkles of an exported head on a MeshPhysicalMaterial.
//
//   const gltf = await new GLTFLoader().loadAsync("head.glb");
//   const face = await FacialAppearance.of(gltf);         // null for a file without the extension
//   face.setWeights({ joy: 0.8, blush: 1 });              // expressions and states of the head's rig
//   face.setTime(2.5);                                    // or: the sequence, with an AnimationMixer at the same time
//
// Formulas: docs/facial-appearance.md beside this folder. What is not done here: scattering (blur the diffuse light for it),
// combination shapes and in-betweens of rigs (the file's animation has them baked).
import * as THREE from "three";

const NAME = "RUBOR_facial_appearance";

export class FacialAppearance {
  /** Replaces the materials of the skin. Resolves to null where the file does not carry the extension. */
  static async of(gltf) {
    const data = gltf.parser.json.extensions?.[NAME];
    if (!data) return null;
    if (data.version !== 1) throw new Error(`${NAME}: found version ${data.version}, expected 1`);
    const face = new FacialAppearance();
    await face.load(gltf, data);
    return face;
  }

  async load(gltf, data) {
    this.data = data;
    this.maps = data.maps ?? {};
    this.rig = data.rig ?? { expressions: {}, states: {} };
    this.zones = this.maps.zones ?? [];
    this.distributions = this.maps.distributions ?? [];
    this.meshes = [];
    this.skins = [];
    gltf.scene.traverse((object) => {
      const place = gltf.parser.associations.get(object);
      if (!object.isMesh || place?.meshes !== data.mesh) return;
      this.meshes.push(object);
      if (data.parts[place.primitives ?? 0]?.material === "skin") this.skins.push(object);
    });
    const images = new Images(gltf);
    if (this.maps.melanin && this.maps.hemoglobin && data.skinLookUp) await this.loadColor(images, data.skinLookUp);
    if (this.maps.slopes || this.maps.wrinkleSlopes?.length) await this.loadRelief(images);
    await this.loadAnimation(gltf, data.skinAnimation);
    images.dispose();
    for (const mesh of this.skins) {
      // Colours of vertices and shapes stand in for the extension in programs that do not know it.
      mesh.geometry.deleteAttribute("color");
      delete mesh.geometry.morphAttributes.color;
      mesh.geometry.dispose();
      mesh.material = this.material(mesh.material);
    }
    this.setWeights({});
  }

  // ---- Colour: melanin, hemoglobin, hair; the mean of the neutral blood and its distributions.

  async loadColor(images, lookUp) {
    const { maps } = this;
    const [melanin, hemoglobin, hair] =
      [await images.map(maps.melanin), await images.map(maps.hemoglobin), maps.hair && (await images.map(maps.hair))];
    const { width, height } = hemoglobin;
    // Addresses of the look-up are cube roots, of which 8 bits are enough where they would not be of the values.
    const texels = new Uint8Array(4 * width * height);
    const at = (map, x, y) => map.value(0, Math.floor((x * map.width) / width), Math.floor((y * map.height) / height));
    const address = (value, most) => Math.round(255 * Math.cbrt(clamp(value / most, 0, 1)));
    for (let y = 0, i = 0; y < height; y++) for (let x = 0; x < width; x++, i += 4) {
      texels[i] = address(at(melanin, x, y), lookUp.mostMelanin);
      texels[i + 1] = address(at(hemoglobin, x, y), lookUp.mostHemoglobin);
      texels[i + 3] = hair ? Math.round(255 * clamp(at(hair, x, y), 0, 1)) : 0;
    }
    this.skinTexture = texture(texels, width, height, THREE.RGBAFormat, THREE.UnsignedByteType, true);
    const table = await images.read(lookUp.image);
    this.lookUpTexture = texture(table.data, table.width, table.height, THREE.RGBAFormat, THREE.UnsignedByteType, false);
    this.lookUpTexture.colorSpace = THREE.SRGBColorSpace;
    this.mostHemoglobin = lookUp.mostHemoglobin;

    this.mean = maps.hemoglobinMean ? await images.map(maps.hemoglobinMean) : null;
    this.blood = [];
    for (const d of this.distributions) this.blood.push({ scale: await images.map(d.scale), bias: await images.map(d.bias) });
    const size = this.mean ?? { width: 1, height: 1 };
    this.bloodTexels = new Uint16Array(4 * size.width * size.height);
    this.bloodTexture = texture(this.bloodTexels, size.width, size.height, THREE.RGBAFormat, THREE.HalfFloatType, false);
  }

  // ---- Relief: slopes of the skin and of wrinkles, masks of the zones that they fade in.

  async loadRelief(images) {
    const { maps } = this;
    // Skin that its author made smooth has wrinkles alone.
    const slopes = maps.slopes && (await images.map(maps.slopes));
    this.slopesTexture = texture(slopes?.pairs() ?? new Uint8Array(2), slopes?.width ?? 1, slopes?.height ?? 1,
      THREE.RGFormat, THREE.UnsignedByteType, true);
    this.slopesCode = slopes?.code() ?? new THREE.Vector4();
    const wrinkles = [];
    for (const entry of (maps.wrinkleSlopes ?? []).slice(0, 4)) wrinkles.push(await images.map(entry));
    // One size for all layers: heads of rubor have it; others lose what is not like the first.
    const same = wrinkles.filter((w) => w.width === wrinkles[0].width && w.height === wrinkles[0].height);
    const { width, height } = same[0] ?? { width: 1, height: 1 };
    const layers = new Uint8Array(2 * width * height * Math.max(same.length, 1)).fill(128);
    same.forEach((w, i) => layers.set(w.pairs(), 2 * width * height * i));
    this.wrinklesTexture = new THREE.DataArrayTexture(layers, width, height, Math.max(same.length, 1));
    Object.assign(this.wrinklesTexture, { format: THREE.RGFormat, unpackAlignment: 1, ...MIPS, needsUpdate: true });
    this.wrinklesCode = [0, 1, 2, 3].map((i) => same[i]?.code() ?? new THREE.Vector4());
    this.wrinkleCount = same.length;
    this.masks = [];
    for (const zone of this.zones) this.masks.push(await images.map(zone.mask, zone.channel));
    const mask = this.masks[0] ?? { width: 1, height: 1 };
    this.weightTexels = new Uint8Array(4 * mask.width * mask.height);
    this.weightTexture = texture(this.weightTexels, mask.width, mask.height, THREE.RGBAFormat, THREE.UnsignedByteType, false);
  }

  async loadAnimation(gltf, entry) {
    if (!entry) return;
    const read = async (index) => (index === undefined ? null : (await gltf.parser.getDependency("accessor", index)).array);
    this.animation = {
      times: await read(entry.times), zones: await read(entry.zoneWeights),
      distributions: await read(entry.distributionWeights), scales: await read(entry.hemoglobinScales),
    };
  }

  // ---- The material: that of the file, with base colour and normal replaced.

  material(from) {
    const material = from.clone();
    material.vertexColors = false;
    // With a normal map three.js makes the tangent frame `tbn`.
    if (this.slopesTexture) material.normalMap ??= texture(new Uint8Array([128, 128, 255, 255]), 1, 1, THREE.RGBAFormat, THREE.UnsignedByteType, false);
    // Skin with a colour by itself shows it: its base colour, which blood moves.
    const own = this.skinTexture && this.maps.albedo && material.map;
    if (this.skinTexture && !own) material.map = null;
    const uniforms = {
      faSkin: { value: this.skinTexture }, faBlood: { value: this.bloodTexture }, faLookUp: { value: this.lookUpTexture },
      faSlopes: { value: this.slopesTexture }, faSlopesCode: { value: this.slopesCode },
      faWrinkles: { value: this.wrinklesTexture }, faWrinklesCode: { value: this.wrinklesCode },
      faWeights: { value: this.weightTexture }, faHemoglobinScale: (this.scale ??= { value: 1 }),
      faMostHemoglobin: { value: this.mostHemoglobin },
      faHair: { value: new THREE.Vector3(...(this.maps.hairColorLinear ?? [0, 0, 0])) },
    };
    material.onBeforeCompile = (shader) => {
      Object.assign(shader.uniforms, uniforms);
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", "#include <common>\nvarying vec2 faUv;")
        .replace("#include <uv_vertex>", "#include <uv_vertex>\nfaUv = uv;");
      let fragment = shader.fragmentShader.replace("#include <common>", `#include <common>\n${DECLARATIONS}`);
      if (this.skinTexture) fragment = fragment.replace("#include <map_fragment>", COLOR + (own ? OWN_COLOR : LOOKED_UP_COLOR));
      if (this.slopesTexture)
        fragment = fragment.replace("#include <normal_fragment_maps>", relief(this.wrinkleCount));
      shader.fragmentShader = fragment;
    };
    material.customProgramCacheKey = () => `${NAME} ${!!this.skinTexture} ${!!own} ${!!this.slopesTexture} ${this.wrinkleCount}`;
    return material;
  }

  // ---- Weights

  /** Names that `setWeights` knows. */
  get names() {
    return { expressions: Object.keys(this.rig.expressions ?? {}), states: Object.keys(this.rig.states ?? {}) };
  }

  /** Weights 0 to 1 of expressions and states by name: shapes, wrinkles and blood as the rig has them. */
  setWeights(weights) {
    const shapes = {}, zones = {}, distributions = {};
    let scale = 1;
    const known = new Set(this.distributions.map((d) => d.name));
    for (const [name, weight] of Object.entries(weights)) {
      let effect = this.rig.expressions?.[name] ?? this.rig.states?.[name];
      if (!effect) throw new Error(`found ${name}, expected an expression or state of the rig`);
      if (effect.fallback && Object.keys(effect.hemoglobin ?? {}).some((d) => !known.has(d))) effect = effect.fallback;
      const add = (to, list) => Object.entries(list ?? {}).forEach(([k, w]) => (to[k] = (to[k] ?? 0) + weight * w));
      add(shapes, effect.shapes);
      add(zones, effect.wrinkles);
      add(distributions, effect.hemoglobin);
      scale += weight * ((effect.hemoglobinScale ?? 1) - 1);
    }
    for (const mesh of this.meshes) {
      mesh.morphTargetInfluences?.fill(0);
      for (const [name, weight] of Object.entries(shapes)) {
        const index = mesh.morphTargetDictionary?.[name];
        if (index !== undefined) mesh.morphTargetInfluences[index] = clamp(weight, 0, 1);
      }
    }
    const sum = Math.max(1, this.distributions.reduce((s, d) => s + (distributions[d.name] ?? 0), 0));
    this.setSkin(this.zones.map((z) => clamp(zones[z.name] ?? 0, 0, 1)),
      this.distributions.map((d) => (distributions[d.name] ?? 0) / sum), Math.max(0, scale));
  }

  /** The skin at a time of the sequence that the file carries, seconds; the file's animation moves the mesh. */
  setTime(time) {
    const a = this.animation;
    if (!a) return;
    const last = a.times.length - 1;
    let k = a.times.findIndex((t) => t > time);
    k = k < 0 ? last : Math.max(k - 1, 0);
    const n = Math.min(k + 1, last), f = n > k ? clamp((time - a.times[k]) / (a.times[n] - a.times[k]), 0, 1) : 0;
    const row = (list, count) => Array.from({ length: count }, (_, i) =>
      list[k * count + i] * (1 - f) + list[n * count + i] * f);
    this.setSkin(a.zones ? row(a.zones, this.zones.length) : [], a.distributions ? row(a.distributions, this.distributions.length) : [],
      row(a.scales, 1)[0]);
  }

  /** Weights of zones and distributions in the order of the file, and the factor of all hemoglobin. */
  setSkin(zones, distributions, hemoglobinScale) {
    (this.scale ??= { value: 1 }).value = hemoglobinScale;
    if (this.bloodTexture) {
      const half = THREE.DataUtils.toHalfFloat, { width, height } = this.bloodTexture.image;
      for (let i = 0, texel = 0; texel < width * height; texel++, i += 4) {
        const mean = this.mean ? this.mean.at(0, texel) : 0;
        let bias = 0, scale = 0;
        for (let d = 0; d < this.blood.length; d++) if (distributions[d]) {
          bias += distributions[d] * (this.blood[d].bias.at(0, texel) - mean);
          scale += distributions[d] * (this.blood[d].scale.at(0, texel) - 1);
        }
        this.bloodTexels[i] = half(bias), this.bloodTexels[i + 1] = half(scale), this.bloodTexels[i + 2] = half(mean);
      }
      this.bloodTexture.needsUpdate = true;
    }
    if (this.weightTexture) {
      const sums = new Float32Array(this.weightTexels.length);
      this.masks.forEach((mask, z) => {
        const layer = this.zones[z].wrinkleMap;
        if (!zones[z] || layer >= this.wrinkleCount) return;
        for (let i = 0; i < sums.length / 4; i++) sums[4 * i + layer] += zones[z] * mask.at(0, i);
      });
      for (let i = 0; i < sums.length; i++) this.weightTexels[i] = Math.round(255 * clamp(sums[i], 0, 1));
      this.weightTexture.needsUpdate = true;
    }
  }
}

const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
const MIPS = { generateMipmaps: true, minFilter: THREE.LinearMipmapLinearFilter, magFilter: THREE.LinearFilter, anisotropy: 8 };

function texture(data, width, height, format, type, mips) {
  const made = new THREE.DataTexture(data, width, height, format, type);
  Object.assign(made, mips ? MIPS : { minFilter: THREE.LinearFilter, magFilter: THREE.LinearFilter });
  made.unpackAlignment = 1;
  made.needsUpdate = true;
  return made;
}

/** A map of the extension: texels 0 to 1 per channel, and value = offset + scale * texel. */
class SkinMap {
  constructor(entry, image, channel) {
    const stacked = entry.layout === "stacked";
    this.width = image.width;
    this.height = stacked ? image.height / 2 : image.height;
    this.data = image.data;
    this.offset = entry.offset;
    this.scale = entry.scale;
    const first = entry.layout === "channel" ? channel : 0;
    this.starts = stacked ? [0, 4 * this.width * this.height] : [first, first + 1];
  }
  at(channel, texel) {
    return this.offset[channel] + (this.scale[channel] * this.data[this.starts[channel] + 4 * texel]) / 255;
  }
  value(channel, x, y) {
    return this.at(channel, y * this.width + x);
  }
  /** Both channels as bytes, for a shader that applies `code`. */
  pairs() {
    const out = new Uint8Array(2 * this.width * this.height);
    for (let i = 0; i < out.length; i++) out[i] = this.data[this.starts[i & 1] + 4 * (i >> 1)];
    return out;
  }
  code() {
    return new THREE.Vector4(...this.offset, ...this.scale);
  }
}

/** Exact bytes of images: a 2D canvas would multiply them by alpha. */
class Images {
  constructor(gltf) {
    this.parser = gltf.parser;
    this.gl = new OffscreenCanvas(1, 1).getContext("webgl2");
    this.known = new Map();
  }
  async map(entry, channel = 0) {
    return new SkinMap(entry, await this.read(entry.image), channel);
  }
  read(index) {
    if (!this.known.has(index)) this.known.set(index, this.decode(index));
    return this.known.get(index);
  }
  async decode(index) {
    const image = this.parser.json.images[index];
    const bytes = image.bufferView === undefined
      ? await (await fetch(new URL(image.uri, new URL(this.parser.options.path, location.href)))).arrayBuffer()
      : await this.parser.getDependency("bufferView", image.bufferView);
    const bitmap = await createImageBitmap(new Blob([bytes], { type: image.mimeType }), { premultiplyAlpha: "none", colorSpaceConversion: "none" });
    const { gl } = this, { width, height } = bitmap;
    const data = new Uint8Array(4 * width * height);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, bitmap);
    gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, gl.getParameter(gl.TEXTURE_BINDING_2D), 0);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, data);
    return { width, height, data };
  }
  dispose() {
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }
}

const DECLARATIONS = /* glsl */ `
  varying vec2 faUv;
  uniform sampler2D faSkin, faBlood, faLookUp, faSlopes, faWeights;
  uniform mediump sampler2DArray faWrinkles;
  uniform vec4 faSlopesCode, faWrinklesCode[4];
  uniform vec3 faHair;
  uniform float faHemoglobinScale, faMostHemoglobin;
`;

// Blood is the neutral blood plus the change that the distributions make to its local mean and contrast.
const COLOR = /* glsl */ `
  vec4 faTexel = texture2D(faSkin, faUv);
  vec3 faChange = texture2D(faBlood, faUv).xyz;
  float faNeutral = faMostHemoglobin * faTexel.g * faTexel.g * faTexel.g;
  float faHemoglobin = faNeutral + faChange.x + faChange.y * (faNeutral - faChange.z);
  faHemoglobin = clamp(faHemoglobinScale * faHemoglobin, 0.0, faMostHemoglobin);
  vec2 faAddress = vec2(faTexel.r, pow(faHemoglobin / faMostHemoglobin, 1.0 / 3.0));
  vec2 faSize = vec2(textureSize(faLookUp, 0));
  vec3 faColor = textureLod(faLookUp, (faAddress * (faSize - 1.0) + 0.5) / faSize, 0.0).rgb;
  float faHidden = 0.97 * smoothstep(0.0, 0.85, faTexel.a);
`;
const LOOKED_UP_COLOR = /* glsl */ `
  diffuseColor.rgb = mix(faColor, faHair, faHidden) * (1.0 - 0.3 * faHidden);
`;
const OWN_COLOR = /* glsl */ `
  #include <map_fragment>
  vec3 faRest = textureLod(faLookUp, (faTexel.rg * (faSize - 1.0) + 0.5) / faSize, 0.0).rgb;
  diffuseColor.rgb = min(diffuseColor.rgb * clamp((faColor + 0.002) / (faRest + 0.002), 0.25, 4.0), 1.0);
  diffuseColor.rgb = mix(diffuseColor.rgb, faHair, faHidden) * (1.0 - 0.3 * faHidden);
`;

const relief = (wrinkles) => /* glsl */ `
  vec2 faSlope = faSlopesCode.xy + faSlopesCode.zw * texture2D(faSlopes, faUv).rg;
  vec4 faWeight = texture2D(faWeights, faUv);
  ${Array.from({ length: wrinkles }, (_, i) =>
    `faSlope += faWeight[${i}] * (faWrinklesCode[${i}].xy + faWrinklesCode[${i}].zw * texture(faWrinkles, vec3(faUv, ${i}.0)).rg);`).join("\n  ")}
  normal = normalize(normal + faSlope.x * tbn[0] + faSlope.y * tbn[1]);
`;

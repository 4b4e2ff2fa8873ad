/** The data blocks of the page: gzip in base64, unpacked on demand. */

/**
 * @param {string} id
 * @returns {Promise<string | null>} null if there is no such block
 */
async function unpacked(id) {
  const block = document.getElementById(id)?.textContent;
  if (!block) return null;
  const bytes = Uint8Array.from(atob(block.trim()), (character) => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).text();
}

/**
 * Returns a name on one line, without characters that reorder or hide text; Python has cleaned all other texts.
 * @param {string} name
 */
function plainLine(name) {
  return name.replace(/[\s\p{Cc}\p{Cf}\p{Zl}\p{Zp}\p{Cs}]+/gu, " ").trim();
}

/** @type {Promise<Record<string, MeshData>> | null} */
let meshesOfPage = null;

/** @returns {Promise<Record<string, MeshData>>} the meshes of all replays by digest */
function sharedMeshes() {
  meshesOfPage ??= unpacked("meshes").then((text) => {
    const meshes = JSON.parse(text ?? "{}");
    for (const mesh of Object.values(meshes)) summed(mesh);
    return meshes;
  });
  return meshesOfPage;
}

/**
 * Decodes differences: points relative to the one before, corners relative to the first one of the triangle.
 * @param {MeshData} mesh
 */
function summed({ points, triangles }) {
  for (let i = 3; i < points.length; i++) points[i] += points[i - 3];
  let first = 0;
  for (let i = 0; i < triangles.length; i += 3) {
    first += triangles[i];
    triangles[i] = first;
    triangles[i + 1] += first;
    triangles[i + 2] += first;
  }
}

/**
 * @param {string} id
 * @returns {Promise<Replay>}
 */
async function unpackedReplay(id) {
  const text = await unpacked(id);
  if (text === null) throw new Error("the replay is missing in this file");
  const replay = JSON.parse(text);
  replay.scene.meshes = await sharedMeshes();
  const { scene, signals, channels } = replay;
  for (const named of [...scene.links, ...scene.bodies, ...signals, ...channels]) named.name = plainLine(named.name);
  for (const signal of [...signals, ...channels]) signal.unit = plainLine(signal.unit);
  for (const channel of channels) channel.group = plainLine(channel.group);
  for (const seen of [...(replay.scans ?? []), ...(replay.cameras ?? [])]) seen.sensor = plainLine(seen.sensor);
  replay.joint_names = replay.joint_names.map(plainLine);
  return replay;
}

/**
 * @param {TextColumn} column
 * @returns {Column} with its differences as numbers
 */
function plainColumn(column) {
  const deltas = Array.from(column.deltas, (character) => {
    const code = character.charCodeAt(0) - 0x20;
    return code % 2 ? -(code + 1) / 2 : code / 2;
  });
  return { ...column, deltas };
}

/**
 * @param {Column} column
 * @param {number} count number of moments
 * @returns {Float64Array} the values, NaN in gaps
 */
function decoded(column, count) {
  const values = new Float64Array(count);
  let steps = column.first;
  for (let i = 0; i < count; i++) {
    if (i > 0 && column.deltas.length) steps += column.deltas[i - 1];
    values[i] = column.scale * steps;
  }
  for (const [start, length] of column.gaps) values.fill(NaN, start, start + length);
  return values;
}

/** The blocks of the page: gzip in base64, unpacked when they are needed. */

/**
 * @param {string} id
 * @returns {Promise<string | null>} null: there is no such block
 */
async function unpacked(id) {
  const block = document.getElementById(id)?.textContent;
  if (!block) return null;
  const bytes = Uint8Array.from(atob(block.trim()), (character) => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).text();
}

/** @type {Promise<Record<string, MeshData>> | null} */
let meshesOfPage = null;

/** @returns {Promise<Record<string, MeshData>>} what all replays share, by digest */
function sharedMeshes() {
  meshesOfPage ??= unpacked("meshes").then((text) => (text ? JSON.parse(text) : {}));
  return meshesOfPage;
}

/**
 * @param {string} id
 * @returns {Promise<Replay>}
 */
async function unpackedReplay(id) {
  const text = await unpacked(id);
  if (text === null) throw new Error("the replay is not in this file");
  const replay = JSON.parse(text);
  replay.scene.meshes = await sharedMeshes();
  return replay;
}

/**
 * @param {Column} column
 * @param {number} count how many moments it has
 * @returns {Float64Array} NaN where there is no value
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

/** Leaves out of three.js what the viewer's materials never use: shaders of others, remarks in shaders, environment maps. */

import { readFileSync } from "node:fs";

const SHADERS = /three\/src\/renderers\/shaders\/Shader(?:Chunk|Lib)\/(\w+)\.glsl\.js$/;
/** Lines and marks, solids, points, shadows; the last one stands before each of them. */
const USED = ["meshbasic", "meshlambert", "points", "depth", "colorspace_pars_fragment"];

/** @param {string} three its folder */
export function lean(three) {
  const source = `${three}/src/renderers/shaders`;
  const kept = withIncluded(source, USED);
  return {
    name: "lean",
    setup(/** @type {import("esbuild").PluginBuild} */ build) {
      build.onResolve({ filter: /^three$/ }, () => ({ path: `${three}/src/Three.js` }));
      build.onLoad({ filter: SHADERS }, ({ path }) => {
        const [, name] = SHADERS.exec(path) ?? [];
        const text = readFileSync(path, "utf8");
        return { contents: kept.has(name) ? bare(text) : text.replace(/`[^`]*`/g, "``"), loader: "js" };
      });
      build.onLoad({ filter: /three\/src\/extras\/PMREMGenerator\.js$/ }, () => ({
        contents: "export class PMREMGenerator {}",
        loader: "js",
      }));
    },
  };
}

/** Shaders, and what they include. @param {string} source @param {string[]} names */
function withIncluded(source, names) {
  const all = new Set();
  const waiting = [...names];
  for (let name = waiting.pop(); name !== undefined; name = waiting.pop()) {
    if (all.has(name)) continue;
    all.add(name);
    for (const [, included] of text(source, name).matchAll(/#include <(\w+)>/g)) waiting.push(included);
  }
  return all;
}

/** @param {string} source @param {string} name */
function text(source, name) {
  for (const folder of ["ShaderLib", "ShaderChunk"]) {
    try {
      return readFileSync(`${source}/${folder}/${name}.glsl.js`, "utf8");
    } catch {
      // It is in the other folder.
    }
  }
  return "";
}

/** Shaders without remarks and indents; every line stays one, for the preprocessor. @param {string} text */
function bare(text) {
  return text.replace(/`[^`]*`/g, (shader) =>
    shader.replace(/\/\*[\s\S]*?\*\/|\/\/[^\n`]*/g, "").replace(/[ \t]+/g, " ").replace(/\s*\n\s*/g, "\n"));
}

/** Builds the 3D viewer into the package: `node build.mjs [FILE]`. The same sources make the same bytes. */

import { readFileSync, statSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";
import { lean } from "./shaders.mjs";

const here = fileURLToPath(new URL(".", import.meta.url));
// Whoever hands three.js on hands its licence on.
const licence = readFileSync(`${here}node_modules/three/LICENSE`, "utf8").trim();
const file = process.argv[2] ?? `${here}../sim_action/reports/viewer/viewer3d.js`;

await build({
  entryPoints: ["src/view3d.ts"],
  absWorkingDir: here,
  outfile: file,
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  charset: "ascii",
  plugins: [lean(`${here}node_modules/three`)],
  legalComments: "none",
  banner: { js: `/*! three.js\n${licence}\n*/` },
});
console.log(`${file}: ${(statSync(file).size / 1000).toFixed(0)} kB`);

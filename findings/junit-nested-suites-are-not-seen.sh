#!/usr/bin/env bash
# junit2html and xunitparser: tests in a suite inside of a suite are not there, and no failure is
#
# Packages: junit2html 31.1.4, xunitparser 1.3.4, junitparser 5.0.3
# Guess: A failed test in a <testsuite> inside of a <testsuite> is in every report; readers differ at most in its
#   name.
# Seen: junitparser finds 1 failure. junit2html prints 0 tests and 0 failures, and xunitparser finds no test. Neither
#   warns.
# Matters to: reports that were merged, or that group suites by package or robot: a red run looks green.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet junit2html==31.1.4 xunitparser==1.3.4 junitparser==5.0.3
cat > try.py <<'END'
import io
import re
import subprocess

import junitparser
import xunitparser

REPORT = """<testsuites><testsuite name="arm"><testsuite name="grasp" tests="1" failures="1">
<testcase classname="grasp" name="holds" time="1"><failure message="dropped"/></testcase></testsuite></testsuite></testsuites>"""
with open("report.xml", "w") as file:
    file.write(REPORT)

report = junitparser.JUnitXml.fromfile("report.xml")
report.update_statistics()
print(f"seen junitparser: {report.tests} tests, {report.failures} failures")
suite, result = xunitparser.parse(io.StringIO(REPORT))
print(f"seen xunitparser: {len(list(suite))} tests, {len(result.failures)} failures")
subprocess.run(["venv/bin/junit2html", "report.xml", "report.html"], check=True)
with open("report.html") as file:
    words = re.sub(r"<style.*?</style>|<[^>]+>", " ", file.read(), flags=re.S).split()
counts = [words[words.index(name) + 1] for name in ("Tests", "Failures")]
print(f"seen junit2html: {counts[0]} tests, {counts[1]} failures")
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen junitparser: 1 tests, 1 failures
seen xunitparser: 0 tests, 0 failures
seen junit2html: 0 tests, 0 failures'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"

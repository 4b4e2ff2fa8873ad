# Makes a private environment from the locked requirements, once per job. PYTHON is the interpreter to make it with.
set -euo pipefail

lock="$GITHUB_ACTION_PATH/requirements.lock"
venv="$RUNNER_TEMP/sim-action"

# The copy of the lock file is the last thing to arrive: with it, the environment is complete.
if cmp --silent "$lock" "$venv/requirements.lock"; then
  exit 0
fi

# pip starts a second interpreter, which -I does not reach.
unset PYTHONPATH PYTHONHOME

# pip serves from outside: to install it into the environment would take longer than to make it.
"$PYTHON" -I -m venv --clear --without-pip "$venv"
# Most of what is installed is never imported, so nothing is compiled ahead.
"$PYTHON" -I -m pip --python "$venv/bin/python" install --quiet --disable-pip-version-check --no-input --no-compile \
  --require-hashes --only-binary :all: --no-deps --requirement "$lock"
cp "$lock" "$venv/requirements.lock"

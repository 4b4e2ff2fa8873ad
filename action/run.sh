# Runs the scenarios that INPUT_SCENARIO names, one path per line, and exits as sim-action does.
set -euo pipefail

case "$INPUT_FAIL_ON_FAILURE" in
  true | false) ;;
  *)
    echo "::error title=sim-action::the input fail-on-failure must be true or false"
    exit 2
    ;;
esac

paths=()
while read -r path; do
  if [[ -n "$path" ]]; then
    paths+=("$path")
  fi
done <<< "$INPUT_SCENARIO"

# -P: a module in the working directory must not stand in for one of ours.
unset PYTHONHOME
PYTHONPATH="$GITHUB_ACTION_PATH" "$RUNNER_TEMP/sim-action/bin/python" -P -m sim_action run \
  --output-dir="$INPUT_OUTPUT_DIRECTORY" -- "${paths[@]}" &

# A cancelled workflow signals this shell alone: pass it on, and let the reports be written. A signal ends `wait` early.
trap 'kill -TERM "$!"' INT TERM
code=0
wait "$!" || code=$?
while kill -0 "$!" 2> /dev/null; do
  code=0
  wait "$!" || code=$?
done

if [[ "$code" == 1 && "$INPUT_FAIL_ON_FAILURE" == false ]]; then
  exit 0
fi
exit "$code"

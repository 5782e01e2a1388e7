#!/bin/sh
# Several recordings of one mounting: a study of each, and whether they saw one mounting.
# Usage: several_drives.sh FOLDER CAPTURE.lcm...     imuscope must be on the PATH
set -eu
folder=$1
shift
mkdir -p "$folder"

runs=
for capture in "$@"; do
  run=$folder/$(basename "$capture" .lcm)
  imuscope process "$capture" --out "$run" >"$run.txt"
  runs="$runs $run"
done
# Names of runs have no spaces here.
# shellcheck disable=SC2086
imuscope combine $runs
# The first two beside each other, as a page.
if [ $# -ge 2 ]; then
  # shellcheck disable=SC2086
  set -- $runs
  imuscope report "$1" "$2" --out "$folder/comparison.html"
fi

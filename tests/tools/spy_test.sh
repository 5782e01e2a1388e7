#!/usr/bin/env bash
# The real lcm-spy, started by tools/spy under a display without a screen, on a bus that carries every message type:
# it finds our types, decodes every channel and opens one. The screenshots stay in the folder given.
# Usage: spy_test.sh SOURCE_DIR BUILD_DIR FOLDER        exit code 77: not possible here, with the reason
set -uo pipefail
source_dir=$1 build_dir=$2 folder=$3

skip() { echo "skipped: $1"; exit 77; }
fail() { echo "FAILED: $1"; tail -n 20 "$folder/spy.log"; exit 1; }

if [ "${4:-}" != inside ]; then
  for program in java Xvfb openbox xdotool import; do
    command -v $program >/dev/null || skip "$program is not installed (tools/setup)"
  done
  rm -rf "$folder" && mkdir -p "$folder"
  unshare -n true 2>/dev/null || skip "a private network namespace needs root"
  exec unshare -n "$0" "$1" "$2" "$3" inside
fi

ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo || fail "no private network"
started=()
stop_all() { kill "${started[@]}" 2>/dev/null; wait 2>/dev/null; }
trap stop_all EXIT

# A display number of the X server's own choice: it writes it when it is ready.
mkfifo "$folder/display"
Xvfb -displayfd 3 -screen 0 1400x900x24 3>"$folder/display" 2>"$folder/xvfb.log" &
started+=($!)
read -t 20 -r number <"$folder/display" || fail "the X server does not start"
export DISPLAY=:$number
openbox >/dev/null 2>&1 &
started+=($!)
"$build_dir/bin/example_bus" 60 &
started+=($!)
LCM_DEFAULT_URL='udpm://239.255.76.67:7667?ttl=0' "$source_dir/tools/spy" --jar "$build_dir/share/java/lcmtypes_imuscope.jar" \
  >"$folder/spy.log" 2>&1 &
started+=($!)

# Tries the rest of its arguments for at most $1 seconds.
within() {
  local end=$((SECONDS + $1))
  shift
  until "$@"; do
    [ $SECONDS -lt $end ] || return 1
    sleep 0.3
  done
}

types=$(ls "$source_dir"/src/publish/lcm/*.lcm | wc -l)
within 40 grep -q "Found $types LCM types" "$folder/spy.log" || fail "lcm-spy does not find our $types types"
window_of() { xdotool search --onlyvisible --name "$1" 2>/dev/null | tail -n 1; }
has_window() { [ -n "$(window_of "$1")" ]; }
within 40 has_window 'LCM Spy' || fail "lcm-spy opens no window"
sleep 3
import -window root "$folder/channels.png" || fail "no screenshot"
# A double click on the first channel, under the table's head, opens its fields.
xdotool mousemove --window "$(window_of 'LCM Spy')" 75 28 click --repeat 2 --delay 100 1
within 20 has_window 'IMUSCOPE_CALIBRATION_MTX1' || fail "a double click does not open a channel's fields"
sleep 2
import -window root "$folder/fields.png" || fail "no screenshot"
for picture in channels fields; do
  colours=$(identify -format %k "$folder/$picture.png")
  [ "$colours" -gt 20 ] || fail "$picture.png shows $colours colours: nothing is drawn"
done
echo "lcm-spy found $types types; see channels.png and fields.png in the test's folder"

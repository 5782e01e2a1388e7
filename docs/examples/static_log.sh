#!/bin/sh
# From the log of a sensor at rest to its page and to the configuration of filters.
# Usage: static_log.sh LOG.csv FOLDER     any columns and units; imuscope must be on the PATH
set -eu
log=$1 folder=$2

imuscope characterize "$log" --out "$folder" --force
# What each filter is told: its own file, with where the numbers come from in its head.
for filter in kalibr px4 kf-gins gtsam; do
  # A filter that cannot take what this sensor does is refused with the reason; the others go on.
  imuscope export "$folder/certificate.json" --to "$filter" >"$folder/$filter.txt" || rm -f "$folder/$filter.txt"
done
ls "$folder"

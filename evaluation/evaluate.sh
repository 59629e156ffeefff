#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs the whole evaluation and renews docs/evaluation.md: evaluate.sh BUILD
#
# Results and pictures stay in BUILD/evaluation. A real flow is taken from $RIFFLE_DATA (else ../shared/data); without it
# its rows are missing.
set -euo pipefail
cd "$(dirname "$0")/.."

build=$1
out=$build/evaluation
docs=docs/evaluation
methods=(lagrangian lagrangian-fine optimize directional eulerian eulerian-short eulerian-long dual dual-plain sprites warp)

rm -rf "$out"
mkdir -p "$out" "$docs"

# run NAME ARGUMENTS...: one part of the results, on one thread; as many at a time as there are processors.
parts=()
run() {
    local name=$1
    shift
    while [ "$(jobs -rp | wc -l)" -ge "$(nproc)" ]; do sleep 0.2; done
    "$build/evaluation_run" "$@" threads=1 > "$out/$name.csv" &
    parts+=("$!")
}

# Waits for all parts; one that failed stops here.
finish() {
    local part
    for part in "${parts[@]}"; do wait "$part"; done
}

# join NAME PART...: their lines under one header.
join() {
    local name=$1 part
    shift
    head -1 "$out/$1.csv" > "$out/$name.csv"
    for part in "$@"; do tail -n +2 "$out/$part.csv" >> "$out/$name.csv"; done
}

for flow in vortex turbulence cylinder wind; do
    for exemplar in noise foam lava pebbles; do
        run "main-$flow-$exemplar" main "flow=$flow" "exemplar=$exemplar" "out=$out"
    done
done
for flow in vortex turbulence; do
    for exemplar in noise foam; do run "sweep-$flow-$exemplar" sweep frames=100 "flow=$flow" "exemplar=$exemplar"; done
done
finish
join main main-{vortex,turbulence,cylinder,wind}-{noise,foam,lava,pebbles}
join sweep sweep-{vortex,turbulence}-{noise,foam}
"$build/evaluation_page" "$out/main.csv" "$out/sweep.csv" docs/evaluation.md "$docs"

# A sheet an exemplar: a row a flow, a column a method.
for exemplar in noise foam lava pebbles; do
    cells=()
    for flow in vortex turbulence cylinder wind; do
        [ -e "$out/$flow-$exemplar-warp.png" ] || continue
        for method in "${methods[@]}"; do
            cells+=("$out/$flow-$exemplar-$method.png")
        done
    done
    "$build/examples/contact_sheet" "$out/$exemplar.png" --columns ${#methods[@]} --cell 150 "${cells[@]}"
    ffmpeg -nostdin -loglevel error -y -i "$out/$exemplar.png" -q:v 8 "$docs/$exemplar.jpg"
done
echo "renewed docs/evaluation.md and $docs"

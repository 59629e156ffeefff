#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Textures four built-in flows with built-in exemplars: demo.sh BUILD
# Leaves frames, videos and one contact sheet in BUILD/demo.
set -euo pipefail

build=$1
riffle=$build/riffle
out=$build/demo
frames=120

rm -rf "$out"
mkdir -p "$out"
cells=()

# scene NAME FLOW WxH EXEMPLAR [options]: one row of the sheet: exemplar, flow, four frames.
scene() {
    local name=$1 flow=$2 size=$3 exemplar=$4
    shift 4
    echo "$name: $exemplar on $flow"
    mkdir -p "$out/$name"
    "$riffle" texture "$flow" "$exemplar" "$out/$name/frame.%04d.png" -o "$out/$name.mp4" --frames 1-$frames --size "$size" \
        --progress none "$@"
    "$riffle" render "$flow" "$out/$name/flow.%04d.png" --as lic --frames $frames-$frames --size "$size" \
        --progress none
    cells+=("$exemplar" "$out/$name/flow.0$frames.png")
    for n in 0001 0040 0080 0120; do
        cells+=("$out/$name/frame.$n.png")
    done
}

# Simulated flows are computed on half the frame's resolution; speeds are in their cells.
scene river "builtin:river?size=512x512" 512x512 builtin:foam
scene cylinder "builtin:cylinder?size=256x128&speed=1" 512x256 builtin:lava
scene gyre "builtin:gyre?size=512x256" 512x256 builtin:pebbles
scene fire "builtin:turbulence?size=256x256&speed=1" 512x512 "builtin:noise?size=512&scale=2" --shader fire

"$build/examples/contact_sheet" "$out/sheet.png" --columns 6 --cell 256 "${cells[@]}"

echo
echo "frames: $(find "$out" -name 'frame.*.png' | wc -l) PNG files in $out/{river,cylinder,gyre,fire}/"
echo "videos: $out/{river,cylinder,gyre,fire}.mp4"
echo "sheet:  $out/sheet.png (a row each: exemplar, flow, frames 1, 40, 80 and 120)"

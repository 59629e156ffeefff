#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Contact sheets of real and built-in inputs: gallery.sh BUILD [--docs] [NAME...]
#
# Leaves one sheet a pair of flow and exemplar in BUILD/gallery: exemplar, flow, four frames. Real inputs are taken from
# $RIFFLE_DATA (else ../shared/data); those that are absent are left out, with a line. With --docs the sheets marked
# `free` are also put into docs/gallery as JPEG: made from inputs that the program draws itself, or whose licence is CC0,
# MIT, BSD, ISC or Apache or that are in the public domain. With names only those sheets are made.
set -euo pipefail
cd "$(dirname "$0")/.."

build=$1
shift
docs=""
[ "${1:-}" != --docs ] || { docs=$1; shift; }
names=" $* "
riffle=$build/riffle
out=$build/gallery
data=${RIFFLE_DATA:-../shared/data}
largest=300000

mkdir -p "$out"

wanted() {
    [ "$names" = "  " ] || [[ $names == *" $1 "* ]]
}

present() {
    [[ $1 == builtin:* || -e $1 ]] || { echo "skipped: $2: $1 is not there"; return 1; }
}

# publish NAME: the sheet as a JPEG of at most $largest bytes.
publish() {
    local quality
    mkdir -p docs/gallery
    for quality in 3 5 8 12 18; do
        ffmpeg -nostdin -loglevel error -y -i "$out/$1.png" -q:v "$quality" "docs/gallery/$1.jpg"
        [ "$(stat -c %s "docs/gallery/$1.jpg")" -gt $largest ] || return 0
    done
    echo "gallery.sh: docs/gallery/$1.jpg is larger than $largest bytes" >&2
    return 1
}

# sheet NAME free|other FLOW EXEMPLAR LAST [options]: frames 1 to LAST of the flow, from its first one on.
sheet() {
    local name=$1 licence=$2 flow=$3 exemplar=$4 last=$5 reading=() drawing=() folder first n
    shift 5
    wanted "$name" || return 0
    present "$flow" "$name" && present "$exemplar" "$name" || return 0
    # What the flow is read with goes to the picture of the flow, too.
    while [ $# -gt 0 ]; do
        case "$1" in
            --velocity-scale | --moment-every | --variables | --fps | --size) reading+=("$1" "$2") ;;
            *) drawing+=("$1" "$2") ;;
        esac
        shift 2
    done
    folder=$out/$name
    rm -rf "$folder"
    mkdir -p "$folder"
    first=$("$riffle" info "$flow" --json | sed -nE 's/.*"first_frame": ?([0-9]+).*/\1/p')
    last=$((first + last - 1))
    echo "$name"
    "$riffle" texture "$flow" "$exemplar" "$folder/frame.%04d.png" -y --frames "$first-$last" --progress none \
        "${reading[@]}" "${drawing[@]}"
    "$riffle" render "$flow" "$folder/flow.%04d.png" -y --as lic --frames "$last-$last" --progress none "${reading[@]}"
    local cells=("$exemplar" "$folder/flow.$(printf %04d "$last").png")
    for n in 0 1 2 3; do
        cells+=("$folder/frame.$(printf %04d $((first + (last - first) * n / 3))).png")
    done
    "$build/examples/contact_sheet" "$out/$name.png" --columns 6 --cell 256 "${cells[@]}"
    if [ "$docs" = --docs ] && [ "$licence" = free ]; then
        publish "$name"
    fi
}

# Clouds over built-in turbulence, from above and as a relief: the blended noise is the height, the shader's colours lie
# on it.
clouds() {
    wanted clouds || return 0
    local folder=$out/clouds flow="builtin:turbulence?size=256x256&speed=1" n
    local noise="builtin:noise?size=512&scale=3"
    rm -rf "$folder"
    mkdir -p "$folder"
    echo clouds
    "$riffle" texture "$flow" "$noise" "$folder/height.%04d.png" --frames 1-96 --size 512x512 \
        --progress none
    "$riffle" texture "$flow" "$noise" "$folder/frame.%04d.png" --frames 1-96 --size 512x512 \
        --progress none --shader clouds
    local above=() relief=()
    for n in 1 32 64 96; do
        "$riffle" render "$folder/frame.%04d.png" "$folder/relief.%04d.png" --as relief --frames $n-$n \
            --map "height=$folder/height.%04d.png" --displace 0.06 --size 512x320 --progress none
        above+=("$folder/frame.$(printf %04d $n).png")
        relief+=("$folder/relief.$(printf %04d $n).png")
    done
    local cells=("$noise" "${above[@]}" - "${relief[@]}")
    "$build/examples/contact_sheet" "$out/clouds.png" --columns 5 --cell 256 "${cells[@]}"
    [ "$docs" != --docs ] || publish clouds
}

# Do shapes keep? Exemplar, frame 1 and frame 200, a row a material.
shapes() {
    wanted shapes || return 0
    local folder=$out/shapes cells=() name
    rm -rf "$folder"
    mkdir -p "$folder"
    echo shapes
    for name in bubbles foam pebbles lava; do
        "$riffle" texture "builtin:turbulence?size=256x256&speed=1" "builtin:$name" "$folder/$name.%04d.png" \
            --frames 1-200x199 --size 512x512 --progress none
        cells+=("builtin:$name" "$folder/$name.0001.png" "$folder/$name.0200.png")
    done
    "$build/examples/contact_sheet" "$out/shapes.png" --columns 3 --cell 320 "${cells[@]}"
    [ "$docs" != --docs ] || publish shapes
}

flows=$data/flows2d
exemplars=$data/exemplars
# Speeds of one to four pixels a frame; the moments spread over the frames drawn.
wind=(--velocity-scale 0.06 --moment-every 12 --size 720x360)
piv=(--velocity-scale 1.5 --moment-every 20 --size 492x516)
turbulence=(--velocity-scale 10 --size 512x512)

# The pictures of the README.
sheet river-foam free "builtin:river?size=512x512" builtin:foam 96
sheet cylinder-lava free "builtin:cylinder?size=256x128&speed=1" builtin:lava 96 --size 512x256
sheet gyre-pebbles free "builtin:gyre?size=512x256" builtin:pebbles 96
sheet eddies-bubbles free "builtin:turbulence?size=256x256&speed=1" builtin:bubbles 96 --size 512x512
clouds
shapes

# Real flows: wind (public domain, ISC), particle image velocimetry (BSD), a slice of turbulence (MIT).
for flow in wind:gfs_wind piv:pivpy_day2 turbulence:example_data_HIT.nc; do
    name=${flow%%:*}
    declare -n options=$name
    sheet "$name-lava" other "$flows/${flow#*:}" "$exemplars/stk_lava.png" 96 "${options[@]}"
    sheet "$name-foam" free "$flows/${flow#*:}" builtin:foam 96 "${options[@]}"
    sheet "$name-grass" free "$flows/${flow#*:}" "$exemplars/skimage_grass.png" 96 "${options[@]}"
done

echo "sheets: $out/*.png"

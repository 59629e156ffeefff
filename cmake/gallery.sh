#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Contact sheets of real and built-in inputs: gallery.sh BUILD [--docs] [NAME...]
#
# Leaves one sheet a pair of flow and exemplar in BUILD/gallery: exemplar, flow, four frames. Real inputs are taken from
# $RIFFLE_DATA (else ../shared/data); those that are absent are left out, with a line. With --docs the sheets marked
# `free` are also put into docs/gallery as JPEG: made from inputs that the program draws itself, or whose licence is CC0,
# MIT, BSD, ISC or Apache or that are in the public domain. With names only those sheets are made. Stills beside other
# tools' are sheets, too: peers-EXEMPLAR.
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

# publish NAME [WIDTH]: the sheet as a JPEG of at most $largest bytes, shrunk to WIDTH where it is wider.
publish() {
    local quality narrower=()
    [ $# = 1 ] || narrower=(-vf "scale='min(iw,$2)':-2:flags=area")
    mkdir -p docs/gallery
    for quality in 3 5 8 12 18; do
        ffmpeg -nostdin -loglevel error -y -i "$out/$1.png" "${narrower[@]}" -q:v "$quality" "docs/gallery/$1.jpg"
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

# What optimize keeps: exemplar, frames 1, 100 and 200, and frame 200 of lagrangian, a row a material.
kept() {
    wanted kept || return 0
    local folder=$out/kept cells=() pair flow exemplar name n
    rm -rf "$folder"
    mkdir -p "$folder"
    echo kept
    for pair in "vortex $exemplars/ps_reptil_skin.pgm" "vortex $exemplars/skimage_brick.png" \
        "turbulence builtin:pebbles" "turbulence builtin:lava"; do
        read -r flow exemplar <<<"$pair"
        present "$exemplar" kept || continue
        name=$folder/$(basename "${exemplar#builtin:}")
        "$riffle" texture "builtin:$flow?size=512x512" "$exemplar" "$name.%04d.png" --method optimize \
            --frames 1-200 --progress none
        "$riffle" texture "builtin:$flow?size=512x512" "$exemplar" "$name.lagrangian.%04d.png" --frames 1-200x199 \
            --progress none
        cells+=("$exemplar" "$name.0001.png" "$name.0100.png" "$name.0200.png" "$name.lagrangian.0200.png")
    done
    "$build/examples/contact_sheet" "$out/kept.png" --columns 5 --cell 320 "${cells[@]}"
    [ "$docs" != --docs ] || publish kept
}

# along NAME free|other FLOW EXEMPLAR [options] FLOW EXEMPLAR ...: a row a pair: exemplar, flow, frames 1, 30, 70,
# 100 and 200 by --method directional (or what the pair's options say).
along() {
    local name=$1 licence=$2 folder=$out/$1 cells=() row=0 flow exemplar n reading width
    shift 2
    wanted "$name" || return 0
    rm -rf "$folder"
    mkdir -p "$folder"
    echo "$name"
    while [ $# -gt 0 ]; do
        flow=$1 exemplar=$2
        shift 2
        reading=(--method directional)
        while [ $# -gt 0 ] && [[ $1 == --* ]]; do
            reading+=("$1" "$2")
            shift 2
        done
        present "$exemplar" "$name" || continue
        row=$((row + 1))
        "$riffle" texture "$flow" "$exemplar" "$folder/$row.%04d.png" "${reading[@]}" --frames 1-200 --progress none \
            2>/dev/null
        "$riffle" render "$flow" "$folder/$row.flow.%04d.png" --as lic --frames 1-1 --progress none
        cells+=("$exemplar" "$folder/$row.flow.0001.png")
        for n in 0001 0030 0070 0100 0200; do
            cells+=("$folder/$row.$n.png")
        done
    done
    [ $row = 0 ] || "$build/examples/contact_sheet" "$out/$name.png" --columns 7 --cell 320 "${cells[@]}"
    if [ $row -gt 0 ] && [ "$docs" = --docs ] && [ "$licence" = free ]; then
        publish "$name" 1120
    fi
}

# labelled FROM TO LINE1 [LINE2]: the picture below two lines of text.
labelled() {
    local font="font=Sans:fontcolor=0xe8e8e8:x=2:expansion=none" room="pad=iw:ih+56:0:56:color=0x1c1c1c"
    ffmpeg -nostdin -loglevel error -y -i "$1" -frames:v 1 -pix_fmt rgb24 -vf \
        "$room,drawtext=$font:fontsize=26:y=2:text='$3',drawtext=$font:fontsize=20:y=32:text='${4:-}'" "$2"
}

# peers free|other EXEMPLAR: the exemplar, Riffle's still and what other tools made of it, with their figures, all as
# bench_synth judges them.
peers() {
    local licence=$1 exemplar=$2 name=peers-$2 cells=() folder tool residual share spectrum
    local made=$data/reference/peers/$exemplar
    wanted "$name" || return 0
    present "$made/exemplar.png" "$name" || return 0
    folder=$out/$name
    rm -rf "$folder"
    mkdir -p "$folder"
    echo "$name"
    RIFFLE_DATA=$data "$build/bench_synth" peers runs=1 only="$exemplar" out="$folder" >"$folder/figures.csv"
    labelled "$made/exemplar.png" "$folder/exemplar.cell.png" exemplar
    cells=("$folder/exemplar.cell.png")
    while IFS=, read -r _ tool residual share spectrum _; do
        [ "$tool" = riffle ] || cp "$made/$tool.png" "$folder/$tool.png"
        [ "$tool" != riffle ] || mv "$folder/$exemplar.png" "$folder/riffle.png"
        labelled "$folder/$tool.png" "$folder/$tool.cell.png" "$tool" \
            "residual $residual   share $share   spectrum $spectrum dB"
        cells+=("$folder/$tool.cell.png")
    done < <(grep "^$exemplar," "$folder/figures.csv")
    "$build/examples/contact_sheet" "$out/$name.png" --columns 3 --cell 512 "${cells[@]}"
    if [ "$docs" = --docs ] && [ "$licence" = free ]; then
        publish "$name" 1080
    fi
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
kept

# Directional texture: the scenes of the paper (parallel, round at one speed and at one angular speed, saddles and
# centres), an unsteady one, one with an obstacle; exemplars; and where it fails, beside what it is to beat.
along directional-scenes free \
    "builtin:uniform?size=512x512&u=1.5&v=0.75" builtin:canes \
    "builtin:rotation?size=512x512" builtin:canes --speed-min 2 --speed-max 2 \
    "builtin:rotation?size=512x512&turn=0.5" builtin:canes \
    "builtin:vortex?size=512x512" builtin:canes \
    "builtin:gyre?size=512x512&epsilon=0" builtin:canes \
    "builtin:gyre?size=512x512&period=100" builtin:canes \
    "builtin:cylinder?size=256x256&speed=1" builtin:canes --size 512x512
vortex="builtin:vortex?size=512x512"
along directional-exemplars other \
    "$vortex" "$exemplars/stk_grass3.jpg" "$vortex" "$exemplars/krita_11_drawed_furry.png" \
    "$vortex" "$exemplars/stk_water_light.png" "$vortex" "$exemplars/ps_reptil_skin.pgm" \
    "$vortex" "$exemplars/oa_lavahell2.png" "$vortex" "$exemplars/stk_oldWood.png"
along directional-limits free \
    "$vortex" builtin:canes --method warp "$vortex" builtin:pebbles "$vortex" "$exemplars/skimage_brick.png"

# Real flows: wind (public domain, ISC), particle image velocimetry (BSD), a slice of turbulence (MIT).
for flow in wind:gfs_wind piv:pivpy_day2 turbulence:example_data_HIT.nc; do
    name=${flow%%:*}
    declare -n options=$name
    sheet "$name-lava" other "$flows/${flow#*:}" "$exemplars/stk_lava.png" 96 "${options[@]}"
    sheet "$name-foam" free "$flows/${flow#*:}" builtin:foam 96 "${options[@]}"
    sheet "$name-grass" free "$flows/${flow#*:}" "$exemplars/skimage_grass.png" 96 "${options[@]}"
done

# Stills, each of 512 x 512 pixels from 128 x 128. Free: MIT and CC0, as is what other tools made of them.
for exemplar in ps_nuts ps_reptil_skin wei_161 skimage_brick; do peers free "$exemplar"; done
for exemplar in stk_lava stk_grass3 krita_18b_WaveFlex gimp_stone33; do peers other "$exemplar"; done

echo "sheets: $out/*.png"

#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Holds every #include below src/, cli/, examples/ and include/ to src/layers.txt. Prints each offence as file:line.
set -euo pipefail
cd "$(dirname "$0")/.."

files=$(git ls-files 'src/*.[ch]' 'cli/*.[ch]' 'examples/*.[ch]' 'include/*.h')
# shellcheck disable=SC2086
awk '
    # The library that a system header belongs to; "" for the C library and POSIX, which every room may include.
    function library(header)
    {
        if (header ~ /^png\.h$/) return "png"
        if (header ~ /^(jpeglib|jerror|turbojpeg)\.h$/) return "jpeg"
        if (header ~ /^(OpenEXR\/)?openexr.*\.h$/) return "openexr"
        if (header ~ /^zlib\.h$/) return "zlib"
        if (header ~ /^expat\.h$/) return "expat"
        if (header ~ /^netcdf.*\.h$/) return "netcdf"
        if (header ~ /^(kissfft\/)?kiss_fft.*\.h$/) return "kissfft"
        if (header ~ /^(cblas|lapacke?)\.h$/) return "lapack"
        if (header ~ /^omp\.h$/) return "openmp"
        if (header ~ /^riffle\//) return "riffle"
        if (header ~ /^[a-z0-9_]+\.h$/ || header ~ /^sys\/[a-z]+\.h$/) return ""
        return header
    }
    function room_of(path)
    {
        if (path ~ /^include\//) return "include"
        if (path ~ /^(cli|examples)\//) return substr(path, 1, index(path, "/") - 1)
        sub(/^src\//, "", path)
        return substr(path, 1, index(path, "/") - 1)
    }
    function offence(why) { printf "%s:%d: %s\n", FILENAME, FNR, why; ++offences }

    FILENAME == "src/layers.txt" {
        if (/^#/ || !NF) next
        room = $1; sub(/:$/, "", room); known[room] = 1
        for (i = 2; i <= NF; ++i) allowed[room, $i] = 1
        next
    }
    FNR == 1 {
        room = room_of(FILENAME)
        folder = FILENAME; sub(/[^\/]*$/, "", folder)
        if (room != "include" && !(room in known)) offence("the room \"" room "\" is not in src/layers.txt")
    }
    /^[ \t]*#[ \t]*include[ \t]*[<"]/ {
        ++includes
        header = $0; sub(/^[^<"]*[<"]/, "", header); sub(/[>"].*$/, "", header)
        if ($0 ~ /</) {
            name = library(header)
            if (name == "" || (name == "riffle" && room != "include")) next
            if (name == "openmp" && room == "core") next
            if (!((room, name) in allowed)) offence(room " may not include <" header ">")
            next
        }
        if (header ~ /\.\.\// ) { offence("\"" header "\": say the room, not the way to it"); next }
        # A name without a folder is a neighbour in the same folder.
        if (header !~ /\//) next
        other = substr(header, 1, index(header, "/") - 1)
        if (other == "riffle" || other == room) next
        if (!((room, other) in allowed)) offence(room " may not include \"" header "\"")
    }
    END {
        printf "%d includes, %d offences\n", includes, offences
        exit offences > 0
    }
' src/layers.txt $files

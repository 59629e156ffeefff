#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Holds the tables in docs/ to the program: doc_tables.sh PROGRAM [--write]
#
# Between the lines "<!-- table: NAME -->" and "<!-- end -->" stands what `PROGRAM NAME` prints (examples/options.c).
# Says where that is not so, or writes it there.
set -euo pipefail
program=$(realpath "$1")
cd "$(dirname "$0")/.."

bad=0 tables=0
for page in docs/*.md; do
    renewed=$(mktemp)
    names=$(sed -nE 's/^<!-- table: ([a-z]+) -->$/\1/p' "$page")
    cp "$page" "$renewed"
    for name in $names; do
        tables=$((tables + 1))
        table=$(mktemp)
        "$program" "$name" >"$table"
        awk -v name="$name" -v table="$table" '
            $0 == "<!-- table: " name " -->" { print; while ((getline line < table) > 0) print line; inside = 1; next }
            $0 == "<!-- end -->" { inside = 0 }
            !inside
        ' "$renewed" >"$renewed.next"
        mv "$renewed.next" "$renewed"
        rm -f "$table"
    done
    if ! cmp -s "$page" "$renewed"; then
        if [ "${2:-}" = --write ]; then
            cat "$renewed" >"$page"
            echo "renewed $page"
        else
            diff "$page" "$renewed" || true
            echo "$page: not what the program says; renew it with: make docs"
            bad=1
        fi
    fi
    rm -f "$renewed"
done
echo "$tables tables"
[ "$bad" = 0 ] && [ "$tables" -gt 0 ]

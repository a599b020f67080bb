#!/usr/bin/env bash
# Instructions per call of each case in benches/instructions.rs, against benches/instructions.txt.
# Fails where a count is more than 5 % above; after a wanted change, or another compiler:
#
#     benches/instructions.sh --update
#
# Counts do not depend on how busy the machine is, so a regression shows that a clock would hide.
# Needs valgrind. The counts are those of x86-64 without extensions.
set -euo pipefail
cd "$(dirname "$0")/.."

counts=benches/instructions.txt
tolerance=5 # per cent

binary=$(cargo bench --quiet --bench instructions --no-run --message-format=json |
    sed -n 's/.*"executable":"\([^"]*\)".*/\1/p' | tail -1)

# The start and end of the program cancel in the difference of two runs.
collected() {
    valgrind --tool=callgrind --callgrind-out-file=/dev/null "$binary" "$1" "$2" 2>&1 |
        sed -n 's/.*Collected : \([0-9]*\).*/\1/p'
}
per_call() { echo $((($(collected "$1" 600) - $(collected "$1" 100)) / 500)); }

if [ "${1:-}" = --update ]; then
    cases=$(sed -n 's/^    ("\([a-z0-9-]*\)", .*/\1/p' benches/instructions.rs)
    for case in $cases; do
        echo "$case $(per_call "$case")"
    done | tee "$counts"
    exit
fi

failed=0
while read -r case wanted; do
    found=$(per_call "$case")
    verdict=ok
    if [ $((found * 100)) -gt $((wanted * (100 + tolerance))) ]; then
        verdict="MORE THAN $tolerance % ABOVE"
        failed=1
    elif [ $((found * (100 + tolerance))) -lt $((wanted * 100)) ]; then
        verdict="less: update"
    fi
    printf '%-20s %8d  was %8d  %s\n' "$case" "$found" "$wanted" "$verdict"
done < "$counts"
exit $failed

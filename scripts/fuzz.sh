#!/usr/bin/env bash
# Feeds the readers with damaged input that coverage guides: scripts/fuzz.sh [SECONDS [TARGET]]
#
# Builds the fuzz targets (tests/fuzz: xdmf, med, modal, results, scene) with coverage and the address sanitizer, and runs each for SECONDS
# (default 12) from tests/fuzz/corpus. A panic, a fault of the C library, more than 10 s or more than 1 GiB fails; the input is kept in
# target/fuzz/findings. Needs x86-64 Linux and a C++ compiler, and is skipped elsewhere.
#
# FUZZ_CORPUS=FOLDER keeps what is found over runs in FOLDER/TARGET; `scripts/fuzz.sh merge FOLDER` takes from it into tests/fuzz/corpus the
# inputs of up to 512 bytes that reach code which the corpus does not.
set -euo pipefail
cd "$(dirname "$0")/.."

targets="xdmf med modal results scene"
seconds=12
merge=
case "${1:-}" in
    "") ;;
    merge) merge=${2:?"name the folder to merge from"} ;;
    *[!0-9]*) echo "fuzz: found \"$1\", expected a number of seconds, or merge FOLDER" >&2; exit 2 ;;
    *) seconds=$1 ;;
esac
if [ -z "$merge" ] && [ $# -gt 1 ]; then
    case " $targets " in *" $2 "*) targets=$2 ;; *) echo "fuzz: found the target \"$2\", expected one of: $targets" >&2; exit 2 ;; esac
fi

triple=x86_64-unknown-linux-gnu
if [ "$(rustc -vV | sed -n 's/^host: //p')" != "$triple" ]; then
    echo "fuzz: skipped: the targets need $triple"
    exit 0
fi
if ! command -v "${CXX:-c++}" >/dev/null; then
    echo "fuzz: skipped: libFuzzer needs a C++ compiler (c++), which is missing"
    exit 0
fi

root=$PWD/target/fuzz
mkdir -p "$root/findings"
# sanitizers are not yet part of the stable toolchain's flags, but its compiler has them
RUSTC_BOOTSTRAP=1 CARGO_TARGET_DIR=$root \
RUSTFLAGS="--cfg fuzzing -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
-Cllvm-args=-sanitizer-coverage-pc-table -Cllvm-args=-sanitizer-coverage-trace-compares -Zsanitizer=address -Ccodegen-units=1 -Cdebug-assertions" \
    cargo build --release --locked --quiet --target "$triple" --manifest-path tests/fuzz/Cargo.toml

# files lie in memory where there is such a place; the folder goes away with this script
scratch=$(mktemp -d -p "$([ -w /dev/shm ] && echo /dev/shm || echo "${TMPDIR:-/tmp}")" pliant-fuzz.XXXXXX)
trap 'rm -rf "$scratch"' EXIT
export TMPDIR=$scratch HDF5_USE_FILE_LOCKING=FALSE
# libhdf5 asks for what a damaged file says and takes a refusal as an error; our own code ends in a fault if it asks for more than 1 GiB
export ASAN_OPTIONS=quarantine_size_mb=16:detect_leaks=0:allocator_may_return_null=1:max_allocation_size_mb=1024
limits="-timeout=10 -rss_limit_mb=1024 -malloc_limit_mb=4194304"

# lists of edits are 8 bytes an edit; texts grow slowly from the shortest
options() {
    case $1 in
        xdmf | scene) echo "-dict=tests/fuzz/$1.dict -max_len=4096" ;;
        *) echo "-len_control=0 -max_len=193" ;;
    esac
}

for target in $targets; do
    program=$root/$triple/release/$target
    corpus=tests/fuzz/corpus/$target
    if [ -n "$merge" ]; then
        merged=$scratch/merged-$target
        mkdir -p "$merged" "$merge/$target" "$scratch/small-$target"
        find "$merge/$target" -type f -size -2 -exec cp -t "$scratch/small-$target" {} +
        # the smallest set of inputs that reaches all edges, counts of passes left aside
        "$program" -merge=1 -use_counters=0 -max_len=4096 $limits "$merged" "$corpus" "$scratch/small-$target" >"$scratch/log" 2>&1 || { tail -n 20 "$scratch/log" >&2; exit 1; }
        rm -rf "$corpus"
        mv "$merged" "$corpus"
        echo "fuzz: $corpus: $(find "$corpus" -type f | wc -l) inputs, $(du -bs "$corpus" | cut -f1) bytes"
        continue
    fi
    store=${FUZZ_CORPUS:-$scratch/corpus}/$target
    mkdir -p "$store"
    before=$(find "$root/findings" -name "$target-*" | sort)
    # shellcheck disable=SC2046
    if "$program" $(options "$target") $limits -max_total_time="$seconds" -artifact_prefix="$root/findings/$target-" "$store" "$corpus" >"$scratch/log" 2>&1; then
        echo "fuzz: $target: $(sed -n 's/^#\([0-9]*\).*DONE *\(cov: [0-9]* ft: [0-9]*\).*/\1 inputs, \2/p' "$scratch/log"), nothing found"
    else
        found=$(comm -13 <(echo "$before") <(find "$root/findings" -name "$target-*" | sort) | head -n 1)
        # libFuzzer measures on the clock, where other work on the machine counts too
        case $found in
            *-timeout-*)
                if "$program" $limits "$found" >/dev/null 2>&1; then
                    rm "$found"
                    echo "fuzz: $target: stopped by an input that took more than 10 s once and does not by itself: the machine was busy"
                    continue
                fi
                ;;
        esac
        tail -n 40 "$scratch/log" >&2
        echo "fuzz: $target: failed on the input ${found:-(none was kept)}" >&2
        echo "fuzz: again: PLIANT_FUZZ_KEEP=FOLDER $program ${found:-INPUT} leaves the files of the input in FOLDER, for pliant import or check" >&2
        exit 1
    fi
done

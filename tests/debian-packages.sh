#!/usr/bin/env bash
# Installs the Debian packages that some tests need and are skipped without.
set -euo pipefail
apt-get update -q
apt-get install -q -y --no-install-recommends \
    chromium nodejs node-typescript clang libclang-rt-dev valgrind libtbb12 gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-user cppcheck libc6-arm64-cross wine wine64

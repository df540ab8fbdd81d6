#!/usr/bin/env bash
# The browser that the tests of the page drive: Debian's Chromium. Whoever is not root installs it by hand.
set -euo pipefail

if command -v chromium >/dev/null; then
    exit 0
fi
if [ "$(id -u)" -eq 0 ] && command -v apt-get >/dev/null; then
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends chromium >/dev/null
else
    echo "there is no chromium, so the tests in a browser are left out; on Debian: apt-get install chromium" >&2
fi

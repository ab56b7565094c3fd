#!/bin/sh
# install.sh WHAT TEST PACKAGE..: installs Debian or Ubuntu packages unless TEST finds something.
# Says what it does; on other systems, or without the right to install, it says what is missing and goes on.
set -u
what=$1
test=$2
shift 2
if [ -n "$(sh -c "$test" 2>/dev/null)" ]; then
    exit 0
fi
if ! command -v apt-get >/dev/null; then
    echo "$what is missing; please install it (on Debian and Ubuntu: $*)"
    exit 0
fi
if [ "$(id -u)" = 0 ]; then as=""; elif command -v sudo >/dev/null; then as="sudo"; else
    echo "$what is missing; please run as root: apt-get install $*"
    exit 0
fi
echo "installing $what: $*"
$as apt-get update -qq && $as apt-get install -y -qq --no-install-recommends "$@" >/dev/null

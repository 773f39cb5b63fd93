#!/bin/sh
# lean_start.sh PROGRAM: what reads pictures brings a hundred libraries, and three quarters of the time of a command that
# reads none: it may not be loaded when a program starts (targets/images/image_codecs.h).
set -eu
loaded=$(LD_TRACE_LOADED_OBJECTS=1 "$1")
case $loaded in *libc.so*) ;; *) echo "not a dynamic program: $1"; exit 1 ;; esac
if echo "$loaded" | grep imgcodecs; then
  echo "$1 loads it before it is needed"
  exit 1
fi

#!/bin/sh
# lean_start.sh PROGRAM: OpenCV's library of image formats brings a hundred others, for maps and medical images, which
# take longer to load than most commands run. heba decodes images itself, and no other library may bring that one.
set -eu
loaded=$(LD_TRACE_LOADED_OBJECTS=1 "$1")
case $loaded in *libc.so*) ;; *) echo "not a dynamic program: $1"; exit 1 ;; esac
if echo "$loaded" | grep -E 'imgcodecs|gdal|gdcm|OpenEXR'; then
  echo "$1 loads it when it starts"
  exit 1
fi
most=100
num=$(echo "$loaded" | wc -l)
if [ "$num" -gt $most ]; then
  echo "$1 loads $num libraries when it starts, more than $most"
  exit 1
fi

#!/bin/sh
# Stands for the program lattice: its replay never ends. Its process identifiers are files in the folder STALLED.
case "$1" in
  --version) echo "lattice 0.0.0" ;;
  replay)
    touch "$STALLED/$$"
    exec sleep 1000
    ;;
esac

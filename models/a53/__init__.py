"""Count what the networks and SGBM execute on a Cortex-A53, under emulation: `make a53`."""

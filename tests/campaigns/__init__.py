"""What the campaigns (tools/faults, tools/big_inputs, tools/soak, tools/latency, ...) share: programs that run imuscope
and imusim many times over, or for long."""

"""What the campaigns (tools/faults, tools/big_inputs) share: programs that run imuscope and imusim many times over."""

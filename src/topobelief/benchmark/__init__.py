"""How long decisions take, side by side in one run: standard belief space planning, t-BSP from scratch, and this engine."""

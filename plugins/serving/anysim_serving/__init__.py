"""Service of envs: `anysim serve`, its client, and pools of many servers."""

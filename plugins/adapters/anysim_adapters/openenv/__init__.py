"""OpenEnv's protocol: envs of tasks for its clients."""

"""How a glider is beside its speed: leaks, battery, devices, attitude. One small pure function a rule."""

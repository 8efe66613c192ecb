"""A UR5e that holds a paddle: control law, scene, robosuite, compiled steps."""

"""The objectives that `rig.yaml` may name, one file each; `objective_registry` finds them."""

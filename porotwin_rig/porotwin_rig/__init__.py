"""A virtual rig: an independent simulator in place of the physical rig, with photographs."""

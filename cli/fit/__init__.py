"""``t2 fit``: the settings of a vehicle, measured in recordings of its motion."""

"""Files for gait laboratories, and comparison of simulated records with measured ones.

World frame: x forward (direction of travel), y up, z to the right; right-handed, in metres, as in OpenSim.
The animal moves in the plane z = 0. Angles are counter-clockwise about z, so that +x turns towards +y.

Signs: forces are the ground's on the limb (ground reaction forces). `force_y` is positive upward,
`force_x` positive forward: braking is negative, propulsion positive. Joint reactions are forces on the link
that is named first by the link that is named second, along the same axes.

Centre of pressure (CoP): the point of the ground's surface about which the forces of toe and heel have no
moment, as a force plate measures it. With vertical forces it is the mean of toe and heel weighted by their
forces. On a slope it lies on the slope, and the force keeps its components along x and y. The free moment is
therefore 0. Where a limb bears no load, or less than the threshold, force and CoP are 0 in every file.

c3d files have the frame of most laboratories instead, in millimetres: x forward, y to the left, z up. Their
channels are in the frames of the plates, x forward along the plate, y right, z down into it, N and N mm, with
the same sign (forces on the limb): Fz is negative under load, and readers that turn channels into the
laboratory's frame, as ezc3d does, find forces that point up. In c3d files of other programs, the normal of
the plates defines the axis that points up, and an option the direction of travel.
"""

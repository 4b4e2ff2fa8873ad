"""Pictures of a scene, by rays of our own: the same on every engine, which only tells where things are.

What the engines offer instead was measured. PyBullet's TinyRenderer draws a ball as a polyhedron whose depth is off by
centimetres, its rays take 60 ms for 160x120 pixels, and MuJoCo renders through a GL library that runners lack. Here a
solid is met where algebra says, only the pixels that it may cover are looked at, and no engine is disturbed.

Solids are in frames of their own; rays are given in such a frame by where they start and by directions whose length
along the view is 1, so that the parameter of a point on a ray is its depth.
"""

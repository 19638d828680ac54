"""What `scripts/benchmark.py` compares pliant with, and the systems it does so on.

    models      rigid models: by formula or random from a seed, written to files that every driver reads
    panel       the flexible panel: one finite-element model for all
    engines     installs the peers, builds their drivers, keeps each as a process that answers lines
    rigid       agreement, then time of forward dynamics and hinge loads
    flexible    agreement, then error against time of runs with flexible bodies; time of an evaluation over modes

Drivers, one program per peer: pinocchio.cpp and mujoco.cpp (with protocol.hpp), drake_peer.py, exudyn_peer.py; pliant's own is
examples/peer. They run in the environment of requirements-benchmark.txt and import nothing of the above but models.
"""

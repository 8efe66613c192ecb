"""Random episodes of every scenario and backend from one seed, as hashes."""

import hashlib

import marl_airhockey as ah


def hashes():
    """Return a line for each scenario and backend."""
    found = []
    for name in ah.scenario_names():
        for backend in ("numba", "pymunk"):
            seats = range(1, len(ah.make_scenario(name).scene.seats))
            episodes = ah.rollout(
                "random",
                name,
                episodes=2,
                seed=7,
                backend=backend,
                max_cycles=150 if backend == "numba" else 30,
                drivers={f"paddle_{k}": "random" for k in seats},
            )
            data = b"".join(v.tobytes() for e in episodes for v in e.columns.values())
            found.append(f"{name} {backend} {hashlib.sha256(data).hexdigest()}")
    return found


if __name__ == "__main__":
    print("\n".join(hashes()))

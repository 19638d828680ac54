#!/usr/bin/env python3
"""Runs the shards of a campaign on a Dask cluster and merges them. Needs dask[distributed] (.venv/dask holds it after scripts/setup.sh).

    .venv/dask/bin/python scripts/campaign/dask_shards.py SCENE.toml PLAN.toml --out FILE.h5 --shards 16 --scheduler tcp://HOST:8786

Without --scheduler a cluster of this machine is started. The folder of FILE.h5 must be one that all workers share. A shard whose worker
is lost is run again, on another one, and goes on where it was; so does the whole command when it is given again.
"""
import argparse
import pathlib
import subprocess
import sys

from dask.distributed import Client, LocalCluster, as_completed

# done, and done with cases that failed: both leave a complete shard
COMPLETE = (0, 3)


def state_file(out, shard, shards):
    """Where pliant sweep keeps a shard."""
    return out.with_name(f"{out.stem}.{shard}-of-{shards}.state.jsonl")


def run_shard(command, shard):
    """Runs one shard on a worker; returns its number, exit code and messages."""
    done = subprocess.run(command, capture_output=True, text=True)
    return shard, done.returncode, done.stderr


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=pathlib.Path, help="the scene (.toml)")
    parser.add_argument("plan", type=pathlib.Path, help="what varies (.toml or .csv)")
    parser.add_argument("--out", type=pathlib.Path, required=True, help="results file to write (.h5)")
    parser.add_argument("--shards", type=int, required=True, help="number of shards: a few for each worker")
    parser.add_argument("--threads", type=int, default=1, help="cases at a time in a shard [default: 1, one core for each thread of a worker]")
    parser.add_argument("--scheduler", help="address of a running scheduler [default: a cluster of this machine]")
    parser.add_argument("--workers", type=int, help="workers of the cluster of this machine [default: one for each core]")
    parser.add_argument("--pliant", default="pliant", help="the program, as the workers find it [default: pliant on PATH]")
    arguments, options = parser.parse_known_args()
    if arguments.shards < 1:
        parser.error("--shards must be 1 or more")
    scene, plan, out = (path.resolve() for path in (arguments.scene, arguments.plan, arguments.out))

    def command(shard):
        return [arguments.pliant, "sweep", str(scene), str(plan), "--out", str(out), "--shard", f"{shard}/{arguments.shards}",
                "--threads", str(arguments.threads), *options]

    cluster = arguments.scheduler or LocalCluster(n_workers=arguments.workers, threads_per_worker=1, dashboard_address=None)
    failed = []
    with Client(cluster) as client:
        # pure=False: a shard is worth running even if Dask remembers one like it
        shards = range(1, arguments.shards + 1)
        futures = [client.submit(run_shard, command(shard), shard, pure=False, key=f"pliant-shard-{shard}-of-{arguments.shards}") for shard in shards]
        for _, (shard, code, messages) in as_completed(futures, with_results=True):
            if code in COMPLETE:
                print(f"shard {shard} of {arguments.shards} is complete", file=sys.stderr)
            else:
                failed.append(shard)
                print(f"shard {shard} of {arguments.shards} ended with {code}:\n{messages}", file=sys.stderr)
    if not arguments.scheduler:
        cluster.close()
    if failed:
        sys.exit(f"shards {', '.join(map(str, sorted(failed)))} are not complete; the same command goes on where they are")
    parts = [str(state_file(out, shard, arguments.shards)) for shard in range(1, arguments.shards + 1)]
    sys.exit(subprocess.run([arguments.pliant, "merge", *parts, "--out", str(out)]).returncode)


if __name__ == "__main__":
    main()

#!/bin/bash
# A Ray cluster of a Slurm job's nodes, and trials of agents.distribute on it. From the checkout, with its .venv:
#
#   sbatch --nodes=4 --cpus-per-task=16 agents/slurm/ray.sh --algo ppo_flat --seeds 64 --out /shared/hoof
#
# The arguments are those of `agents.distribute`; all nodes see --out. The trials of a node that is lost
# go on on the others, and the same command given again runs what is missing.
#SBATCH --job-name=hoof-ray
#SBATCH --output=%x-%j.log
#SBATCH --ntasks-per-node=1
#SBATCH --time=01:00:00
#SBATCH --no-kill
#SBATCH --exclusive

source "${VENV:-.venv}/bin/activate"
# This runs on the first node. ADDRESS says where the others reach it, if not at the first address that it has.
address=${ADDRESS:-$(hostname -I | awk '{ print $1 }')}
RAY_AUTH_TOKEN=$(python -c 'import secrets; print(secrets.token_hex())') # others may reach the nodes, too
export RAY_AUTH_TOKEN RAY_AUTH_MODE=token RAY_USAGE_STATS_ENABLED=0 OMP_NUM_THREADS=1
export RAY_SYMMETRIC_RUN_CLUSTER_WAIT_TIMEOUT=300
result=$(mktemp) # of the trials; the step's own code is that of nodes which are ended with it

srun --no-kill --wait=60 --cpus-per-task="${SLURM_CPUS_PER_TASK:-1}" \
  ray symmetric-run --address "$address:$((20000 + SLURM_JOB_ID % 10000))" \
  --min-nodes "$SLURM_JOB_NUM_NODES" --num-cpus "${SLURM_CPUS_PER_TASK:-1}" -- \
  bash -c 'python -m agents.distribute --address auto "$@"; echo $? >"$0"' "$result" "$@"
code=$(<"$result")
rm "$result"
[ -n "$code" ] || echo 'Ray did not start; its messages are above' >&2
exit "${code:-1}"

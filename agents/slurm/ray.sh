#!/bin/bash
# A Ray cluster of a Slurm job's nodes, and trials of agents.distribute on it. From the checkout, with its .venv:
#
#   sbatch --nodes=4 --cpus-per-task=16 agents/slurm/ray.sh --algo ppo_flat --seeds 64 --out /shared/hoof
#
# The arguments are those of `agents.distribute trials`; all nodes see --out. The trials of a node that is lost
# go on on the others, and the same command given again runs what is missing.
#SBATCH --job-name=hoof-ray
#SBATCH --output=%x-%j.log
#SBATCH --ntasks-per-node=1
#SBATCH --time=01:00:00
#SBATCH --no-kill

source "${VENV:-.venv}/bin/activate"
first=$(scontrol show hostnames "$SLURM_JOB_NODELIST" | head -n 1)
address=$(scontrol show node "$first" --oneliner | sed 's/.*NodeAddr=\([^ ]*\).*/\1/')
RAY_AUTH_TOKEN=$(python -c 'import secrets; print(secrets.token_hex())') # others work on the nodes, too
export RAY_AUTH_TOKEN RAY_AUTH_MODE=token RAY_USAGE_STATS_ENABLED=0

srun --no-kill ray symmetric-run --address "$address:$((20000 + SLURM_JOB_ID % 10000))" \
  --min-nodes "$SLURM_JOB_NUM_NODES" --num-cpus "${SLURM_CPUS_PER_TASK:-1}" -- \
  python -m agents.distribute trials --address auto "$@"

#!/bin/bash
# A training for each seed, as a Slurm array: one node or many, and no Ray. From the checkout, with its .venv:
#
#   sbatch --array=0-9 --cpus-per-task=2 agents/slurm/seeds.sh /shared/hoof --algo ppo_flat
#
# The first argument is the folder of the runs, which all nodes see; the others go to agents.train. A task that
# is requeued goes on from its last checkpoint, and so does the same command given again.
#SBATCH --job-name=hoof-seeds
#SBATCH --output=%x-%A-%a.log
#SBATCH --open-mode=append
#SBATCH --time=01:00:00
#SBATCH --requeue

out=${1:?usage: sbatch --array=0-9 agents/slurm/seeds.sh FOLDER [arguments of agents.train]}
: "${SLURM_ARRAY_TASK_ID:?expected an array: sbatch --array=0-9}"

source "${VENV:-.venv}/bin/activate"
export OMP_NUM_THREADS=1
exec python -m agents.train --seed "$SLURM_ARRAY_TASK_ID" \
  --out "$out/seed-$SLURM_ARRAY_TASK_ID" --resume --torch-threads "${SLURM_CPUS_PER_TASK:-1}" "${@:2}"

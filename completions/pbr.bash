# Completion of the command pbr in bash. SPDX-License-Identifier: MIT
# shellcheck shell=bash

_pbr() {
    local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} command=${COMP_WORDS[1]} words=
    local scene='--size --view --centre --light --ortho --up --grid --splat --blend --shade --colour --cull --occlusion --lod --vertices --threshold --point-cost --time-budget
        --radius-scale --min-size --max-size --low-pass --background --samples --gl'
    COMPREPLY=()
    # Left empty, readline completes names of files.
    case $before in
    --up) words='y z' ;;
    --splat) words='circle square ellipse gaussian ewa ewa-max' ;;
    --blend) words='kind fill' ;;
    --shade) words='phong none deferred phong-field' ;;
    --lod)
        words='none auto qsplat spt pop'
        [[ $command == convert ]] && words='qsplat spt pop'
        ;;
    --colour) words='points normal depth primitive scalar:' ;;
    --gl) words='3.3 4.5 compat es3.0 es3.2' ;;
    -o | --size | --view | --centre | --light | --grid | --radius-scale | --min-size | --max-size | --low-pass | --background | --samples | --threshold | --point-cost | --time-budget | --threads | --memory | --radius | --frames | --ground-truth | --stats | --seed | --screenshots)
        return
        ;;
    *)
        if [[ $COMP_CWORD -eq 1 ]]; then
            words='info convert render view compare synth --help --version'
        elif [[ $COMP_CWORD -eq 2 && $command == synth && $word != -* ]]; then
            words='sphere torus plane checkerboard terrain'
        elif [[ $word == -* ]]; then
            case $command in
            info) words='--json --help' ;;
            convert) words='--lod --normal-fields --memory --radius --threads --json --help' ;;
            render)
                words="-o $scene --frames --refine --orbit --stats --reference --ground-truth --raw --help"
                ;;
            view) words="$scene --screenshots --json --help" ;;
            compare) words='-o --background --levels --json --help' ;;
            synth) words='--mesh --grid --seed --memory --help' ;;
            esac
        fi
        ;;
    esac
    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$word")
}

complete -o default -F _pbr pbr

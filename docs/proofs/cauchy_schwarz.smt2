; cauchy_schwarz: theory §2.4. The work of a force F over a displacement d is at most |F||d|, so the
; worst direction is along the force and (13) holds with norms.
(set-logic QF_NRA)
(declare-const Fx Real)
(declare-const Fy Real)
(declare-const Fz Real)
(declare-const dx Real)
(declare-const dy Real)
(declare-const dz Real)
(declare-const F Real)
(declare-const d Real)
(declare-const work Real)  ; F . d
(declare-const most Real)  ; |F||d|
(assert (= work (+ (* Fx dx) (* Fy dy) (* Fz dz))))
(assert (= most (* F d)))
(assert (and (>= F 0) (= (* F F) (+ (* Fx Fx) (* Fy Fy) (* Fz Fz)))))  ; dropped in the twin
(assert (and (>= d 0) (= (* d d) (+ (* dx dx) (* dy dy) (* dz dz)))))
(assert (>= (+ (* (- (* Fx dy) (* Fy dx)) (- (* Fx dy) (* Fy dx))) (* (- (* Fy dz) (* Fz dy)) (- (* Fy dz) (* Fz dy))) (* (- (* Fz dx) (* Fx dz)) (- (* Fz dx) (* Fx dz)))) 0))  ; hint
(assert (= (* most most) (* (+ (* Fx Fx) (* Fy Fy) (* Fz Fz)) (+ (* dx dx) (* dy dy) (* dz dz)))))  ; hint
(assert (>= most 0))  ; hint
(assert (=> (> work most) (> (* work work) (* most most))))  ; hint
(assert (= (* work work) (* (+ (* Fx dx) (* Fy dy) (* Fz dz)) (+ (* Fx dx) (* Fy dy) (* Fz dz)))))  ; hint
(assert (> work most))  ; negated conclusion
(check-sat)

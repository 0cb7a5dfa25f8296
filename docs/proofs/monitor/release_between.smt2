; release_between: theory §3.2. A force that ended at some time between s1 and s2 got the hand no
; further than at the one time in between that lets it go furthest. Distances along the force.
(set-logic QF_LRA)
(declare-const p Real)      ; v_max s, s when it ended
(declare-const p1 Real)     ; v_max s1
(declare-const p2 Real)     ; v_max s2
(declare-const P Real)      ; v_max T
(declare-const along Real)  ; measured displacement
(declare-const star Real)   ; v_max times the time that is booked
(declare-const b Real)
(assert (and (<= 0 p1) (<= p1 p2) (<= p2 P)))
(assert (<= p1 p))
(assert (<= p p2))  ; dropped in the twin
(assert (= star (ite (<= (/ (+ along P) 2) p1) p1 (ite (>= (/ (+ along P) 2) p2) p2 (/ (+ along P) 2)))))
(assert (= b (ite (<= star (- (+ along P) star)) star (- (+ along P) star))))
(assert (> (ite (<= p (- (+ along P) p)) p (- (+ along P) p)) b))  ; negated conclusion
(check-sat)

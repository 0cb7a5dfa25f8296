; port_drain: theory §2.8. Ports of any units add up: let R be at most what a hand draws on the ports
; counted so far, and r what it really draws there. With one more port, where the effort does work at
; the rate p <= A a, A its size and a the speed, within V, it draws at most R + D, D the drain of that
; port alone. From R = r = 0, by induction over the ports.
(set-logic QF_NRA)
(declare-const fd Real)
(declare-const fco Real)
(declare-const V Real)   ; fastest hand at this port
(declare-const A Real)
(declare-const a Real)
(declare-const p Real)
(declare-const R Real)
(declare-const r Real)
(declare-const e Real)   ; what friction leaves of A
(declare-const D Real)
(assert (and (>= fd 0) (>= fco 0) (> V 0) (>= A 0) (>= a 0)))
(assert (<= r R))
(assert (<= p (* A a)))
(assert (= e (ite (> A fco) (- A fco) 0)))
(assert (=> (<= e (* 2 fd V)) (and (>= D 0) (= (* 4 fd D) (* e e)))))
(assert (=> (> e (* 2 fd V)) (= D (- (* e V) (* fd V V)))))
(assert (<= a V))  ; dropped in the twin
(assert (<= (* (- A fco) a) (* e a)))  ; hint
(assert (=> (<= e (* 2 fd V)) (>= (* (- (* 2 fd a) e) (- (* 2 fd a) e)) 0)))  ; hint
(assert (=> (> e (* 2 fd V)) (>= (* (- V a) (- e (* fd (+ V a)))) 0)))  ; hint
(assert (<= (- (* e a) (* fd a a)) D))  ; hint
(assert (> (+ r (- p (* fco a) (* fd a a))) (+ R D)))  ; negated conclusion
(check-sat)
